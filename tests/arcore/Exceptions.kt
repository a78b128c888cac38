package com.google.ar.core.exceptions

open class UnavailableException : Exception()

class CameraNotAvailableException : Exception()

class NotYetAvailableException : Exception()
