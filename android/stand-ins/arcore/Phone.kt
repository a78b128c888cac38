package com.google.ar.core

/** The phone on which the stand-in of ARCore runs. Tests change it. */
object Phone {
    const val FRAME_MS = 10L
    const val IMAGES_BEFORE_DEPTH = 3
    const val MOST_IMAGES = 6

    @Volatile var availability = ArCoreApk.Availability.UNSUPPORTED_DEVICE_NOT_CAPABLE
    @Volatile var afterChecking = ArCoreApk.Availability.SUPPORTED_INSTALLED
    @Volatile var hasDepth = true
    @Volatile var isCameraTaken = false

    /** Whether frames are too old when their images are acquired. */
    @Volatile var isLate = false

    /** Why the camera does not track. It tracks if this is null. */
    @Volatile var lost: TrackingFailureReason? = null

    /** Images since the start. */
    @Volatile var images = 0L

    /** Dialogues that ask the user to install ARCore. */
    @Volatile var installations = 0
    @Volatile var openSessions = 0
    @Volatile var runningSessions = 0

    /** Images that were acquired and not closed. */
    val openImages: Int get() = StandInImage.open.get()

    /** A phone as it was bought. */
    fun reset(availability: ArCoreApk.Availability) {
        this.availability = availability
        afterChecking = ArCoreApk.Availability.SUPPORTED_INSTALLED
        hasDepth = true
        isCameraTaken = false
        isLate = false
        lost = null
        images = 0
        installations = 0
        openSessions = 0
        runningSessions = 0
        StandInImage.open.set(0)
    }
}
