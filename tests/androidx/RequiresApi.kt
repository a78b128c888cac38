// By hand, for the type checks of `tests/kotlin`: the real one is on Google's Maven alone. Nothing here runs or ships.
package androidx.annotation

annotation class RequiresApi(val value: Int)
