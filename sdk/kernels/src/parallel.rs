//! Loops whose parts run on the threads of the current rayon pool.
//!
//! Most of WebAssembly has no threads. There the same loops run part after part, as rayon would run them on one thread,
//! and rayon is not compiled: its ways to divide each loop would be a tenth of a browser's module.

#[cfg(any(not(target_family = "wasm"), target_feature = "atomics"))]
pub use rayon::{broadcast, current_num_threads, current_thread_index, join, prelude};

#[cfg(any(test, all(target_family = "wasm", not(target_feature = "atomics"))))]
#[allow(unreachable_pub)] // Tests compare it with rayon.
mod sequential;
#[cfg(all(target_family = "wasm", not(target_feature = "atomics")))]
pub use sequential::*;

#[cfg(all(test, not(target_family = "wasm")))]
mod tests {
    /// Defines a function that runs loops by the functions of a module and returns what they make.
    macro_rules! loops {
        ($name:ident, $from:path) => {
            fn $name(items: usize, part: usize) -> Vec<Vec<usize>> {
                use $from::{self as parallel, prelude::*};
                let from: Vec<usize> = (0..items).map(|i| i * i % 17).collect();
                let mut made = vec![from.clone(); 5];
                let [all, parts, exact, each, of_items] = &mut made[..] else {
                    unreachable!()
                };
                for (to, from) in [(&mut *all, &from), (parts, &from)] {
                    (to.par_chunks_mut(part).zip(from.par_chunks(part)).enumerate())
                        .for_each(|(i, (to, from))| to.iter_mut().zip(from).for_each(|(to, from)| *to = i + 2 * from));
                }
                (exact.par_chunks_exact_mut(part).zip(from.par_chunks_exact(part)))
                    .for_each(|(to, from)| to.copy_from_slice(&from.iter().rev().copied().collect::<Vec<_>>()));
                (each.par_iter_mut().with_min_len(2).enumerate()).for_each_init(
                    || vec![0; 3],
                    |memory, (i, item)| {
                        memory[0] = i;
                        *item += memory[0];
                    },
                );
                (of_items.par_iter_mut().zip(&from)).for_each(|(to, from)| *to += from);
                let (rows, more) = ((0..items).into_par_iter(), (5..items).into_par_iter());
                let sum = rows
                    .with_max_len(1)
                    .map(|i| from[i])
                    .chain(more)
                    .reduce_with(|a, b| a + b);
                let (first, second) = parallel::join(
                    || from.par_iter().sum::<usize>(),
                    || from.par_iter().all(|i| *i < 9),
                );
                let largest = from.clone().into_par_iter().max();
                made.push(vec![
                    sum.unwrap_or(99),
                    first,
                    second.into(),
                    largest.unwrap_or(99),
                ]);
                let threads = parallel::broadcast(|_| parallel::current_thread_index().unwrap_or(99));
                assert_eq!(threads, Vec::from_iter(0..parallel::current_num_threads()));
                made
            }
        };
    }
    loops!(on_threads, rayon);
    loops!(one_after_another, super::sequential);

    #[test]
    fn loops_make_the_same_without_threads() {
        for (items, part) in [(0, 3), (1, 1), (7, 3), (64, 16), (65, 16)] {
            assert_eq!(
                on_threads(items, part),
                one_after_another(items, part),
                "{items} {part}"
            );
        }
    }
}
