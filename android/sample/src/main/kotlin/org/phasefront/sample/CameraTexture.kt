package org.phasefront.sample

import android.opengl.EGL14
import android.opengl.EGLConfig
import android.opengl.GLES20

/**
 * A texture that nobody sees, current on the thread that makes it until it is closed: ARCore draws the camera's image into
 * one. [name] is its name in OpenGL.
 */
class CameraTexture : AutoCloseable {
    private val display = EGL14.eglGetDisplay(EGL14.EGL_DEFAULT_DISPLAY)
    private val context: android.opengl.EGLContext
    private val surface: android.opengl.EGLSurface
    val name: Int

    init {
        check(EGL14.eglInitialize(display, null, 0, null, 0)) { "OpenGL does not start" }
        val configs = arrayOfNulls<EGLConfig>(1)
        val needed = intArrayOf(EGL14.EGL_RENDERABLE_TYPE, EGL14.EGL_OPENGL_ES2_BIT, EGL14.EGL_SURFACE_TYPE, EGL14.EGL_PBUFFER_BIT, EGL14.EGL_NONE)
        check(EGL14.eglChooseConfig(display, needed, 0, configs, 0, 1, IntArray(1), 0)) { "OpenGL has no such surface" }
        val version = intArrayOf(EGL14.EGL_CONTEXT_CLIENT_VERSION, 2, EGL14.EGL_NONE)
        context = EGL14.eglCreateContext(display, configs[0], EGL14.EGL_NO_CONTEXT, version, 0)
        val size = intArrayOf(EGL14.EGL_WIDTH, 1, EGL14.EGL_HEIGHT, 1, EGL14.EGL_NONE)
        surface = EGL14.eglCreatePbufferSurface(display, configs[0], size, 0)
        EGL14.eglMakeCurrent(display, surface, surface, context)
        name = IntArray(1).also { GLES20.glGenTextures(1, it, 0) }[0]
    }

    override fun close() {
        EGL14.eglMakeCurrent(display, EGL14.EGL_NO_SURFACE, EGL14.EGL_NO_SURFACE, EGL14.EGL_NO_CONTEXT)
        EGL14.eglDestroySurface(display, surface)
        EGL14.eglDestroyContext(display, context)
    }
}
