//! Russian roulette (Arvo and Kirk 1990): paths that carry little light mostly end, and those left over carry theirs, so that none is
//! lost on average.

use super::batch::PathRadiance;

/// What a path carries of a new one's light, from which on it is worth its rays: ending one that carries more makes more noise than
/// it saves time, one that carries less the other way round (`benches/TRIED.md`).
const FULL_THROUGHPUT: f32 = 0.5;

/// Least share of the paths that roulette ends from vertex [`MIN_TERMINATION_FROM`] on: a path that keeps all its light still ends.
const MIN_TERMINATION: f32 = 0.05;

/// Vertices before that; a mirror or two make no noise.
const MIN_TERMINATION_FROM: u32 = 4;

/// Ends a path at its `n`-th vertex if it carries little, or makes it carry more: on average what it carried. `choice` is drawn
/// where it decides.
pub(super) fn survives(gathered: &mut PathRadiance, compression: f32, n: u32, choice: impl FnOnce() -> f32) -> bool {
    let carried = gathered.throughput.iter().fold(0.0_f32, |most, &x| most.max(x)) / compression;
    let share = (carried / FULL_THROUGHPUT).min(if n < MIN_TERMINATION_FROM { 1.0 } else { 1.0 - MIN_TERMINATION });
    if share < 1.0 && choice() >= share {
        return false;
    }
    gathered.throughput = gathered.throughput.map(|x| x / share);
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of evenly spaced choices the share that survives carries on what all had, to within one choice. Who has half of a new
    /// path's light, or more, never ends early and hardly later.
    #[test]
    fn roulette_keeps_the_light_on_average() {
        const N: u32 = 1000;
        for (carried, compression) in
            [(1e-3, 1.0), (0.02, 1.0), (0.3, 1.0), (0.5, 1.0), (1.0, 1.0), (2.0, 2.25), (0.3, 2.25)]
        {
            for n in [0, MIN_TERMINATION_FROM - 1, MIN_TERMINATION_FROM] {
                let mut sum = 0.0;
                let mut n_left = 0;
                for choice in 0..N {
                    let throughput = [carried, 0.5 * carried, 0.0];
                    let mut gathered = PathRadiance { radiance: [0.0; 3], throughput, n_rays: 1 };
                    if survives(&mut gathered, compression, n, || (choice as f32 + 0.5) / N as f32) {
                        n_left += 1;
                        sum += gathered.throughput[0];
                        let [red, green, blue] = gathered.throughput;
                        assert!((green - 0.5 * red).abs() <= f32::EPSILON * red && blue == 0.0, "{carried}");
                    }
                }
                let of_one = sum / n_left as f32;
                assert!((sum - N as f32 * carried).abs() <= of_one, "{carried} {compression}: {sum}");
                if carried / compression >= FULL_THROUGHPUT {
                    assert_eq!(n_left, if n < MIN_TERMINATION_FROM { N } else { N * 19 / 20 }, "{carried}");
                }
            }
        }
    }
}
