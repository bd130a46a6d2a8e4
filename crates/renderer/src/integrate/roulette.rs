//! Russian roulette (Arvo and Kirk 1990): ends paths with low throughput at random and scales the survivors, without
//! bias.

use super::batch::PathRadiance;

/// Throughput from which paths survive: ending paths above it adds more noise than it saves time, and below it the
/// reverse (`benches/TRIED.md`).
const SURVIVAL_THROUGHPUT: f32 = 0.5;

/// Minimum termination probability from vertex [`MIN_TERMINATION_FROM`] on, so that paths without loss end too.
const MIN_TERMINATION: f32 = 0.05;

/// The first vertices are exempt, because short specular paths add no noise.
const MIN_TERMINATION_FROM: u32 = 4;

/// Whether a path survives at its `n`-th vertex; if so, scales its throughput. `choice` is drawn only if the decision
/// is random.
pub(super) fn survives(accumulated: &mut PathRadiance, compression: f32, n: u32, choice: impl FnOnce() -> f32) -> bool {
    let throughput = accumulated.throughput.iter().fold(0.0_f32, |most, &x| most.max(x)) / compression;
    let probability =
        (throughput / SURVIVAL_THROUGHPUT).min(if n < MIN_TERMINATION_FROM { 1.0 } else { 1.0 - MIN_TERMINATION });
    if probability < 1.0 && choice() >= probability {
        return false;
    }
    accumulated.throughput = accumulated.throughput.map(|x| x / probability);
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For evenly spaced choices, the survivors carry the total throughput to within one path. Paths with high
    /// throughput end only by the minimum probability.
    #[test]
    fn roulette_is_unbiased() {
        const N: u32 = 1000;
        for (throughput, compression) in
            [(1e-3, 1.0), (0.02, 1.0), (0.3, 1.0), (0.5, 1.0), (1.0, 1.0), (2.0, 2.25), (0.3, 2.25)]
        {
            for n in [0, MIN_TERMINATION_FROM - 1, MIN_TERMINATION_FROM] {
                let mut sum = 0.0;
                let mut n_left = 0;
                for choice in 0..N {
                    let rgb = [throughput, 0.5 * throughput, 0.0];
                    let mut path = PathRadiance { radiance: [0.0; 3], throughput: rgb, n_rays: 1 };
                    if survives(&mut path, compression, n, || (choice as f32 + 0.5) / N as f32) {
                        n_left += 1;
                        sum += path.throughput[0];
                        let [red, green, blue] = path.throughput;
                        assert!((green - 0.5 * red).abs() <= f32::EPSILON * red && blue == 0.0, "{throughput}");
                    }
                }
                let of_one = sum / n_left as f32;
                assert!((sum - N as f32 * throughput).abs() <= of_one, "{throughput} {compression}: {sum}");
                if throughput / compression >= SURVIVAL_THROUGHPUT {
                    assert_eq!(n_left, if n < MIN_TERMINATION_FROM { N } else { N * 19 / 20 }, "{throughput}");
                }
            }
        }
    }
}
