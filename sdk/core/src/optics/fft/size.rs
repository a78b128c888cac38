//! Fast transform lengths.

/// Returns the length 2^a·3^b·5^c·7^d of at least `n` with the lowest transform cost. Powers of two are so much faster
/// than other lengths that they are worth some extra values.
pub fn fast_size(n: usize) -> usize {
    // Measured costs of rustfft for a value and a prime factor, in units of a factor 2. The constant is the cost of the
    // rest of a pass.
    const THREE: f64 = 2.2;
    const FIVE: f64 = 4.6;
    const SEVEN: f64 = 4.8;
    const PASS: f64 = 20.0;
    let limit = n.next_power_of_two();
    // Lists the powers of `factor` with their costs.
    let powers = |factor: usize, cost: f64| {
        let powers = (0..).map(move |k| (factor.pow(k), cost * f64::from(k)));
        powers.take_while(move |(power, _)| *power <= limit)
    };
    let mut best = (f64::INFINITY, n);
    for (three, cost_three) in powers(3, THREE) {
        for (five, cost_five) in powers(5, FIVE) {
            if three * five > limit {
                break;
            }
            for (seven, cost_seven) in powers(7, SEVEN) {
                let odd = three * five * seven;
                let two = n.div_ceil(odd).next_power_of_two();
                let units = f64::from(two.ilog2()) + cost_three + cost_five + cost_seven + PASS;
                let size = two * odd;
                let cost = size as f64 * units;
                if cost < best.0 {
                    best = (cost, size);
                }
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_sizes_are_smooth_and_little_larger() {
        for n in 1..3000 {
            let size = fast_size(n);
            let mut rest = size;
            for p in [2, 3, 5, 7] {
                while rest.is_multiple_of(p) {
                    rest /= p;
                }
            }
            assert!(rest == 1 && size >= n, "{n}: {size}");
            assert!(n < 64 || size <= n + n / 7, "{n}: {size}");
        }
        assert_eq!((fast_size(1950), fast_size(1110)), (2048, 1152));
    }
}
