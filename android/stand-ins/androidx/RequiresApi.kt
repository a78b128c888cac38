// A substitute for the type checks of `android/test`: the original is only on Google's Maven. It neither runs nor
// ships.
package androidx.annotation

annotation class RequiresApi(val value: Int)
