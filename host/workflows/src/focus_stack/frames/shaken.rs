//! Shaken or defocused frames are less sharp than both neighbours. The first and the last frame are compared with what the next
//! three suggest: blur grows evenly with the distance from the focus, so a power of the sharpness (which one depends on the
//! texture) is a parabola of the position. A block that is sharpest in the next frame tells nothing: its peak may lie between.
//! Noise looks sharp in dark frames, so a frame is compared with those of about its own brightness only.

/// Part of the sharpness of the less sharp neighbour below which a block is shaken, and part of the blocks that must be.
const SHAKEN: f64 = 0.9;
const SHAKEN_BLOCKS: f64 = 0.6;
/// The same of the expected sharpness in the first or last frame, of blocks that tell it, and the least part of these.
const SHAKEN_END: f64 = 0.85;
const TELLING_BLOCKS: f64 = 0.25;
/// Part of all blocks that are sharper in the first or last frame than in the next: it is not bad, or it shows what no other does.
const SHARP_BLOCKS: f64 = 0.1;
/// Powers of the squared gradient for textures from coarse to fine, and the least blur, as part of that of the next frames.
const POWERS: [f64; 3] = [-1.0, -0.5, -0.25];
const LEAST_BLUR: f64 = 0.7;
/// Largest ratio of the brightness of frames that are compared; exposures of a series differ by 2 or more.
const ALIKE: f64 = 1.9;
/// Fewest frames of which one may be left out.
const LEAST_FRAMES: usize = 5;

#[derive(Debug, Default, PartialEq)]
pub(super) struct Shaken {
    pub frames: Vec<usize>,
    /// First or last frames that cannot be judged.
    pub untold: Vec<usize>,
}

/// From the sharpness by blocks, the position and the brightness of each frame.
pub(super) fn find(sharpness: &[Vec<f64>], positions: &[f64], gains: &[f64], members: &[usize]) -> Shaken {
    let mut found = Shaken { frames: inside(sharpness, gains, members), untold: Vec::new() };
    if members.iter().any(|index| sharpness[*index].is_empty()) {
        return found;
    }
    let kept: Vec<usize> = members.iter().copied().filter(|index| !found.frames.contains(index)).collect();
    let judge = |frames: &[usize]| dull_end(sharpness, positions, frames);
    for mut frames in [kept.clone(), kept.iter().rev().copied().collect()] {
        let Some(&end) = frames.first() else { continue };
        frames.retain(|other| alike(gains, end, *other));
        // If the next frames are not as expected either, this stack is of another kind.
        let of_another_kind =
            || (1..frames.len() - LEAST_FRAMES + 1).any(|first| judge(&frames[first..]) == Some(true));
        match judge(&frames) {
            Some(false) => {}
            Some(true) if !of_another_kind() => found.frames.push(end),
            _ => found.untold.push(end),
        }
    }
    found
}

fn alike(gains: &[f64], one: usize, other: usize) -> bool {
    gains[one].max(gains[other]) <= ALIKE * gains[one].min(gains[other])
}

fn inside(sharpness: &[Vec<f64>], gains: &[f64], members: &[usize]) -> Vec<usize> {
    let is_dull = |at: &usize| {
        let own = members[*at];
        let is_alike = |other: &&usize| alike(gains, own, **other);
        let before = members[..*at].iter().rev().find(is_alike);
        let after = members[at + 1..].iter().find(is_alike);
        let (Some(before), Some(after)) = (before, after) else { return false };
        let neighbours = sharpness[*before].iter().zip(&sharpness[*after]);
        let blocks = sharpness[own].iter().zip(neighbours);
        let dull =
            blocks.clone().filter(|(own, (before, after))| **own < SHAKEN * before.min(**after)).count();
        // A frame with pixels without a value has no sharpness.
        blocks.len() > 0 && dull as f64 >= SHAKEN_BLOCKS * blocks.len() as f64
    };
    (0..members.len()).filter(is_dull).map(|at| members[at]).collect()
}

/// Whether the first of these frames is duller than the next ones suggest, in most of the blocks that tell it. `None` if too few
/// tell it, or if it depends on a frame that may be bad itself.
fn dull_end(sharpness: &[Vec<f64>], positions: &[f64], frames: &[usize]) -> Option<bool> {
    let (&[end, near, middle, far, beyond], true) = (frames.first_chunk()?, frames.len() >= LEAST_FRAMES)
    else {
        return None;
    };
    let tells =
        |block: &usize| frames[2..].iter().any(|frame| sharpness[*frame][*block] > sharpness[near][*block]);
    let blocks = sharpness[end].len();
    let telling: Vec<usize> = (0..blocks).filter(tells).collect();
    if (telling.len() as f64) < TELLING_BLOCKS * blocks as f64 {
        return None;
    }
    let dull = |next: [usize; 3], part: f64| {
        let expected = expectation(sharpness, positions, end, next);
        let dull = telling.iter().filter(|block| sharpness[end][**block] < part * expected(**block)).count();
        dull as f64 >= SHAKEN_BLOCKS * telling.len() as f64
    };
    let sharper = (0..blocks).filter(|block| sharpness[end][*block] > sharpness[near][*block]).count();
    match dull([near, middle, far], SHAKEN_END) {
        // A part that is in focus in this frame only must not be lost.
        true if sharper as f64 >= SHARP_BLOCKS * blocks as f64 => None,
        // Where the middle one is blurred itself, the others contradict it; the outer two only make less be expected.
        true if !dull([near, far, beyond], 1.0) => None,
        verdict => Some(verdict),
    }
}

/// Sharpness of each block of a frame, extrapolated from three others.
fn expectation(
    sharpness: &[Vec<f64>],
    positions: &[f64],
    end: usize,
    [near, middle, far]: [usize; 3],
) -> impl Fn(usize) -> f64 {
    let at = |frame: usize| positions[frame] - positions[end];
    let weight = |of: usize, a: usize, b: usize| at(a) * at(b) / ((at(of) - at(a)) * (at(of) - at(b)));
    let next = [
        (near, weight(near, middle, far)),
        (middle, weight(middle, near, far)),
        (far, weight(far, near, middle)),
    ];
    move |block: usize| {
        let by = |power: f64| {
            let blurs = next.map(|(frame, weight)| (sharpness[frame][block].powf(power), weight));
            let least = blurs.iter().map(|(blur, _)| *blur).fold(f64::INFINITY, f64::min);
            let blur: f64 = blurs.iter().map(|(blur, weight)| blur * weight).sum();
            blur.max(LEAST_BLUR * least).powf(1.0 / power)
        };
        POWERS.map(by).into_iter().fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVEN: [f64; 12] = [1.0; 12];

    /// Blocks at depths from `depths.0` to `depths.1`, as sharp as blur that grows by `slope` px per position makes them.
    fn curves(positions: &[f64], depths: (f64, f64), slope: f64, power: i32) -> Vec<Vec<f64>> {
        let block = |position: f64, block: usize| {
            let depth = depths.0 + (depths.1 - depths.0) * block as f64 / 35.0;
            (1.0 + (slope * (position - depth)).powi(2)).powi(-power)
        };
        positions.iter().map(|position| (0..36).map(|index| block(*position, index)).collect()).collect()
    }

    #[test]
    fn tells_a_dull_end_from_one_that_is_out_of_focus() {
        for slope in [0.15, 0.5, 2.0] {
            for (power, depths) in [(1, (2.0, 8.0)), (2, (-3.0, 6.0)), (2, (4.5, 4.5)), (1, (3.0, 15.0))] {
                for uneven in [0.0, 0.3] {
                    let positions: Vec<f64> =
                        (0..12).map(|index| f64::from(index) + uneven * f64::from(index % 2)).collect();
                    let members: Vec<usize> = (0..12).collect();
                    let good = curves(&positions, depths, slope, power);
                    let found = find(&good, &positions, &EVEN, &members);
                    assert_eq!(found, Shaken::default(), "{slope} {power} {depths:?}");
                    for at in [0, 11] {
                        let mut bad = good.clone();
                        bad[at].iter_mut().for_each(|value| *value *= 0.6);
                        let found = find(&bad, &positions, &EVEN, &members);
                        // Steps of twice the depth of field tell less, and a frame that is sharpest somewhere stays.
                        let tells_less = slope == 2.0 || (depths.0..depths.1).contains(&positions[at]);
                        let untold = tells_less && found.frames.is_empty() && found.untold == [at];
                        assert!(found.frames == [at] || untold, "{slope} {power} {depths:?} {found:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn noise_of_darker_frames_condemns_no_other() {
        let positions: Vec<f64> = (0..12).map(f64::from).collect();
        let members: Vec<usize> = (0..12).collect();
        let gains: Vec<f64> = members.iter().map(|frame| [1.0, 0.3][frame % 2]).collect();
        let mut noisy = curves(&positions, (2.0, 8.0), 0.5, 1);
        noisy.iter_mut().skip(1).step_by(2).flatten().for_each(|value| *value += 0.2);
        assert!(!find(&noisy, &positions, &EVEN, &members).frames.is_empty(), "the noise must matter");
        assert_eq!(find(&noisy, &positions, &gains, &members), Shaken::default());
        noisy[4].iter_mut().for_each(|value| *value *= 0.2);
        assert_eq!(find(&noisy, &positions, &gains, &members).frames, [4]);
    }

    #[test]
    fn a_dull_frame_next_but_one_to_an_end_does_not_condemn_the_end() {
        let positions: Vec<f64> = (0..7).map(f64::from).collect();
        let members: Vec<usize> = (0..7).collect();
        for slope in [0.15, 0.5, 1.0, 2.0] {
            let good = curves(&positions, (1.5, 4.5), slope, 2);
            for at in [2, 4] {
                let mut bad = good.clone();
                bad[at].iter_mut().for_each(|value| *value *= 0.3);
                let found = find(&bad, &positions, &EVEN, &members);
                assert!(!found.frames.iter().any(|frame| [0, 6].contains(frame)), "{slope} {at}: {found:?}");
            }
        }
    }

    /// A close-up: the nearest part is sharp in the first frame only, and the rest is duller there than the next frames suggest.
    #[test]
    fn an_end_in_which_a_part_is_sharpest_is_kept() {
        let positions: Vec<f64> = (0..7).map(f64::from).collect();
        let members: Vec<usize> = (0..7).collect();
        let mut sharpness = curves(&positions, (3.5, 5.5), 0.5, 2);
        sharpness[0].iter_mut().for_each(|value| *value *= 0.5);
        assert_eq!(find(&sharpness, &positions, &EVEN, &members).frames, [0]);
        let near = sharpness[0].len() / 8;
        for (frame, row) in sharpness.iter_mut().enumerate() {
            row[..near].iter_mut().for_each(|value| *value = 1.0 / (1 + frame) as f64);
        }
        assert_eq!(find(&sharpness, &positions, &EVEN, &members), Shaken { frames: vec![], untold: vec![0] });
    }

    #[test]
    fn an_end_next_to_the_focus_or_in_a_short_stack_is_not_judged() {
        let positions: Vec<f64> = (0..8).map(f64::from).collect();
        let members: Vec<usize> = (0..8).collect();
        let focused = curves(&positions, (0.6, 1.4), 1.0, 2);
        assert_eq!(find(&focused, &positions, &EVEN, &members).untold, [0]);
        assert_eq!(find(&focused, &positions, &EVEN, &members[..4]).untold, [0, 3]);
    }
}
