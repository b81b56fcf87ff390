//! The plane that stands for a surface in an element, from where the surface crosses its edges.
//!
//! It is told by its levels at the corners, linear functions that are zero in it, negative in the body. Where a corner is alone on
//! its side there are three crossings, which the plane goes through. Where corners are two and two there are four, and it passes them
//! at equal distances, alternately on either side of them: of all planes that which is nearest to the farthest. As a corner comes to be in the surface, two
//! crossings become one, and this plane becomes that through three; so it moves continuously with the surface.
//!
//! Levels are products of the parts into which edges are cut, sums of which have one sign. So no accuracy is lost where crossings are next to each
//! other.

use super::element::sides;

/// Levels at the corners, the largest of them 1 or -1; `None` where all corners are on one side. `inside` tells which corners are in the body,
/// `part` how much of an edge from a corner that is to one that is not. Where the plane does no more than touch the element along an edge
/// or in a corner, levels are all the same.
pub(super) fn levels(inside: [bool; 4], part: impl Fn(usize, usize) -> f64) -> Option<[f64; 4]> {
    let count = inside.iter().filter(|inside| **inside).count();
    let (levels, is_touched_from_within) = match count {
        2 => {
            let sides = sides(inside);
            let [[a, b], [c, d]] = sides;
            (of_two(sides, &part), part(a, c) + part(a, d) + part(b, c) + part(b, d) > 2.0)
        }
        1 | 3 => {
            let alone = (0..4).find(|&k| inside[k] == (count == 1))?;
            let levels = of_one(alone, |other| match count {
                1 => part(alone, other),
                _ => 1.0 - part(other, alone),
            });
            (if count == 1 { levels } else { levels.map(|level| -level) }, count == 3)
        }
        _ => return None,
    };
    let largest = levels.iter().fold(0.0, |largest: f64, level| largest.max(level.abs()));
    Some(match largest > f64::MIN_POSITIVE {
        true => levels.map(|level| level / largest),
        false => [if is_touched_from_within { -1.0 } else { 1.0 }; 4],
    })
}

/// A corner is alone, and this part of its edge to each other corner is on its side, where levels are negative.
fn of_one(alone: usize, part: impl Fn(usize) -> f64) -> [f64; 4] {
    let others = || (0..4).filter(|&k| k != alone);
    std::array::from_fn(|k| {
        let rest: f64 = others().filter(|&other| other != k).map(&part).product();
        if k == alone { -rest } else { (1.0 - part(k)) * rest }
    })
}

/// Corners a and b are in the body, c and d beside it. The levels at crossings ac, bd and at ad, bc are opposite numbers.
fn of_two([[a, b], [c, d]]: [[usize; 2]; 2], part: impl Fn(usize, usize) -> f64) -> [f64; 4] {
    let [ac, ad, bc, bd] = [part(a, c), part(a, d), part(b, c), part(b, d)];
    let [ca, da, cb, db] = [ac, ad, bc, bd].map(|part| 1.0 - part);
    let mut levels = [0.0; 4];
    levels[a] = -((ac + bc) * ad * db + (ad + bd) * ac * cb);
    levels[b] = -((ad + bd) * bc * ca + (ac + bc) * bd * da);
    levels[c] = (ca + da) * cb * bd + (cb + db) * ca * ad;
    levels[d] = (cb + db) * da * ac + (ca + da) * db * bc;
    levels
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of_surface(distances: [f64; 4]) -> [f64; 4] {
        let inside = distances.map(|distance| distance < 0.0);
        levels(inside, |from, to| distances[from] / (distances[from] - distances[to])).unwrap_or([0.0; 4])
    }

    proptest! {
        /// Whether corners are one and three or two and two.
        #[test]
        fn planes_are_found(distances in [-1.0..-0.01, 0.01..1.0, -1.0..1.0, -1.0..1.0_f64]) {
            let largest = distances.iter().fold(0.0, |largest: f64, distance| largest.max(distance.abs()));
            for (found, distance) in of_surface(distances).into_iter().zip(distances) {
                prop_assert!((found - distance / largest).abs() < 1e-9, "{found} {distance}");
            }
        }

        /// As a corner passes through a surface that is not plane, its edges are cut at any rates.
        #[test]
        fn planes_move_continuously(parts in [0.05..0.95, 0.05..0.95_f64], rates in [0.1..1.0, 0.1..1.0, 0.1..1.0_f64]) {
            const NEAR: f64 = 1e-9;
            // Corner 0 is inside, 1 about to be, 2 and 3 beside the body.
            let before = levels([true, false, false, false], |_, to| match to {
                1 => 1.0 - NEAR * rates[0],
                _ => parts[to - 2],
            });
            let after = levels([true, true, false, false], |from, to| match from {
                0 => parts[to - 2],
                _ => NEAR * rates[to - 1],
            });
            for (before, after) in before.unwrap_or([9.0; 4]).into_iter().zip(after.unwrap_or([0.0; 4])) {
                prop_assert!((before - after).abs() < 1e-6, "{before} {after}");
            }
        }
    }

    #[test]
    fn bodies_that_touch_an_element_fill_nothing_or_all_of_it() {
        assert_eq!(
            levels([true, false, false, false], |_, to| if to == 1 { 0.7 } else { 0.0 }),
            Some([1.0; 4])
        );
        assert_eq!(
            levels([true, true, true, false], |from, _| if from == 1 { 0.7 } else { 1.0 }),
            Some([-1.0; 4])
        );
        assert_eq!(levels([true, true, false, false], |_, _| 0.0), Some([1.0; 4]));
        assert_eq!(levels([false; 4], |_, _| 0.0), None);
    }
}
