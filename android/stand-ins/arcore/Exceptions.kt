// The exceptions that the sample meets, checked and unchecked as in
// https://developers.google.com/ar/reference/java/com/google/ar/core/exceptions/package-summary
package com.google.ar.core.exceptions

open class UnavailableException : Exception()

class UnavailableArcoreNotInstalledException : UnavailableException()

class UnavailableApkTooOldException : UnavailableException()

class UnavailableSdkTooOldException : UnavailableException()

class UnavailableDeviceNotCompatibleException : UnavailableException()

class UnavailableUserDeclinedInstallationException : UnavailableException()

class CameraNotAvailableException : Exception()

class NotYetAvailableException : Exception()

// Nothing makes an app catch these.
class NotTrackingException : RuntimeException()

class ResourceExhaustedException : RuntimeException()

class DeadlineExceededException : RuntimeException()

class FatalException(message: String) : RuntimeException(message)

class SessionPausedException : IllegalStateException()

class TextureNotSetException : IllegalStateException()

class MissingGlContextException : IllegalStateException()
