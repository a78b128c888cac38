//! Minimum and maximum of two numbers, as processors have them.

/// Bounds of a number. A number that is NaN becomes the bound, as with [`f32::min`] and [`f32::max`]. Those also return
/// a number whose bound is NaN, which costs more, and in WebAssembly they call a function for each number.
pub trait Bounds {
    /// Returns the smaller number, or `most` if `self` is NaN.
    fn at_most(self, most: Self) -> Self;
    /// Returns the larger number, or `least` if `self` is NaN.
    fn at_least(self, least: Self) -> Self;
}

macro_rules! bounds {
    ($($number:ty),*) => {$(
        impl Bounds for $number {
            #[inline(always)]
            fn at_most(self, most: Self) -> Self {
                if self < most { self } else { most }
            }

            #[inline(always)]
            fn at_least(self, least: Self) -> Self {
                if self > least { self } else { least }
            }
        }
    )*};
}
bounds!(f32, f64);

#[cfg(test)]
mod tests {
    use super::Bounds;

    #[test]
    fn bounds_are_those_of_the_standard_library_where_they_are_numbers() {
        let numbers = [
            f32::NAN,
            f32::NEG_INFINITY,
            -1.5,
            0.0,
            f32::MIN_POSITIVE,
            2.0,
            f32::INFINITY,
        ];
        for a in numbers {
            for b in &numbers[1..] {
                assert_eq!([a.at_most(*b), a.at_least(*b)], [a.min(*b), a.max(*b)], "{a} {b}");
            }
        }
    }
}
