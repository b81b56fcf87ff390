//! Electrodes from triangles: sheets and plates give their outline, everything else a reason.

use capsense_core::electrode::{Outline, Sheet, SheetError};
use capsense_core::geometry::TriangleMesh;
use capsense_core::glam::{DMat2, DVec2, DVec3};
use proptest::prelude::*;

/// Cells of a square grid that are filled.
const SIDE: usize = 6;
type Cells = [[bool; SIDE]; SIDE];

const CELL: f64 = 0.005;

type Triangle = [DVec3; 3];

fn surface(triangles: &[Triangle]) -> TriangleMesh {
    let vertices = triangles.iter().flatten().copied().collect();
    let indices = (0..triangles.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    TriangleMesh::new(vertices, indices).unwrap()
}

fn sheet(triangles: &[Triangle]) -> Result<Sheet, SheetError> {
    Sheet::of_surface(&surface(triangles))
}

fn quad([a, b, c, d]: [DVec3; 4], other_diagonal: bool) -> [Triangle; 2] {
    if other_diagonal { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] }
}

fn corner(x: usize, y: usize, z: f64) -> DVec3 {
    DVec3::new(CELL * (x as f64 - 2.0), CELL * (y as f64 - 3.0), z)
}

fn filled(cells: &Cells, x: isize, y: isize) -> bool {
    let at = |k: isize| usize::try_from(k).ok().filter(|k| *k < SIDE);
    at(x).zip(at(y)).is_some_and(|(x, y)| cells[y][x])
}

fn places() -> impl Iterator<Item = (usize, usize)> {
    (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y)))
}

/// The filled cells as a sheet, diagonals running this way and that.
fn flat(cells: &Cells, z: f64) -> Vec<Triangle> {
    let of_cell = |(x, y): (usize, usize)| {
        quad(
            [corner(x, y, z), corner(x + 1, y, z), corner(x + 1, y + 1, z), corner(x, y + 1, z)],
            (x + y) % 3 == 0,
        )
    };
    places().filter(|&(x, y)| cells[y][x]).flat_map(of_cell).collect()
}

/// The filled cells as a closed plate.
fn plate(cells: &Cells, low: f64, high: f64) -> Vec<Triangle> {
    let mut triangles = flat(cells, high);
    triangles.extend(flat(cells, low).into_iter().map(|[a, b, c]| [a, c, b]));
    for (x, y) in places().filter(|&(x, y)| cells[y][x]) {
        let (i, j) = (x as isize, y as isize);
        for (beside, a, b) in [
            ((i, j - 1), (x, y), (x + 1, y)),
            ((i + 1, j), (x + 1, y), (x + 1, y + 1)),
            ((i, j + 1), (x + 1, y + 1), (x, y + 1)),
            ((i - 1, j), (x, y + 1), (x, y)),
        ] {
            if !filled(cells, beside.0, beside.1) {
                let at = |(x, y), z| corner(x, y, z);
                triangles.extend(quad([at(a, low), at(b, low), at(b, high), at(a, high)], false));
            }
        }
    }
    triangles
}

/// Whether two filled cells meet in a corner only.
fn touches(cells: &Cells) -> bool {
    let end = SIDE as isize;
    (-1..end).flat_map(|y| (-1..end).map(move |x| (x, y))).any(|(x, y)| {
        let [a, b, c, d] = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| filled(cells, x, y));
        a == d && b == c && a != b
    })
}

/// Membership of the cells' centres, and sides on the grid's lines only.
fn check_outline(outline: &Outline, cells: &Cells, turn: DMat2) {
    for (x, y) in places() {
        let centre = 0.5 * (corner(x, y, 0.0) + corner(x + 1, y + 1, 0.0));
        assert_eq!(outline.contains(turn * centre.truncate()), cells[y][x], "{x} {y} {outline:?}");
    }
}

fn corners(outline: &Outline) -> usize {
    match outline {
        Outline::Polygon(corners) => corners.len(),
        Outline::Contours(contours) => contours.iter().map(Vec::len).sum(),
        _ => panic!("{outline:?}"),
    }
}

/// Corners of the filled cells' border: where an odd number of the four cells around a grid point is filled.
fn true_corners(cells: &Cells) -> usize {
    let end = SIDE as isize;
    let around = |x, y| [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| filled(cells, x, y));
    (-1..end)
        .flat_map(|y| (-1..end).map(move |x| (x, y)))
        .filter(|&(x, y)| around(x, y).into_iter().filter(|f| *f).count() % 2 == 1)
        .count()
}

fn cells() -> impl Strategy<Value = Cells> {
    // Mostly filled: few corners that touch.
    prop::array::uniform6(prop::array::uniform6(prop::bool::weighted(0.8)))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, max_global_rejects: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn filled_cells_are_found_again(
        cells in cells(), order in any::<prop::sample::Selector>(), flips in any::<u64>(), thick in any::<bool>(),
    ) {
        prop_assume!(cells.iter().flatten().any(|filled| *filled));
        let triangles = if thick { plate(&cells, -2e-4, 3e-4) } else { flat(&cells, 3e-4) };
        match sheet(&triangles) {
            Err(SheetError::Touching { .. }) => prop_assert!(touches(&cells)),
            Err(error) => prop_assert!(false, "{error}"),
            Ok(found) => {
                prop_assert!(!touches(&cells));
                prop_assert_eq!(found.z, 3e-4);
                prop_assert_eq!(found.outline.defect(), None);
                check_outline(&found.outline, &cells, DMat2::IDENTITY);
                prop_assert_eq!(corners(&found.outline), true_corners(&cells));
                // In any order, and wound any way.
                let mut mixed: Vec<Triangle> = triangles.clone();
                let last = mixed.len() - 1;
                for k in 0..mixed.len() {
                    let other = order.select(0..=last);
                    mixed.swap(k, other);
                    if flips >> (k % 64) & 1 == 1 {
                        mixed[k].reverse();
                    }
                }
                mixed.reverse();
                prop_assert_eq!(sheet(&mixed), Ok(found));
            }
        }
    }

    /// Turned, and rounded as STL files do it, corner by corner.
    #[test]
    fn rounding_to_single_precision_does_not_tear_a_sheet(
        cells in cells(), angle in 0.0..6.3, thick in any::<bool>(), seed in any::<u64>(),
    ) {
        prop_assume!(cells.iter().flatten().any(|filled| *filled) && !touches(&cells));
        let turn = DMat2::from_angle(angle);
        let mut dice = seed | 1;
        let mut jitter = || {
            dice = dice.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            1.0 + 1.2e-7 * ((dice >> 33) as f64 / (1u64 << 31) as f64 - 0.5)
        };
        let mut rounded = |v: DVec3| {
            let turned = (turn * v.truncate()).extend(v.z);
            DVec3::from_array(turned.to_array().map(|x| f64::from((x * jitter()) as f32)))
        };
        let triangles = if thick { plate(&cells, 0.0, 4e-4) } else { flat(&cells, 4e-4) };
        let triangles: Vec<Triangle> = triangles.into_iter().map(|t| t.map(&mut rounded)).collect();
        match sheet(&triangles) {
            Ok(found) => {
                prop_assert!((found.z - 4e-4).abs() < 1e-9);
                check_outline(&found.outline, &cells, turn);
            }
            // A plate one cell wide is a block.
            Err(SheetError::TooThick { .. }) if thick => {}
            Err(error) => prop_assert!(false, "{error}"),
        }
    }

    /// Whatever the triangles: an outline that encloses something, or a reason.
    #[test]
    fn any_triangles_are_an_outline_or_refused(triangles in soup()) {
        match sheet(&triangles) {
            Ok(found) => {
                prop_assert!(found.z.is_finite());
                prop_assert_eq!(found.outline.defect(), None);
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}

/// Triangles between few places, so that many touch, some in one plane, some with absurd coordinates.
fn soup() -> impl Strategy<Value = Vec<Triangle>> {
    let odd = prop::sample::select(vec![0.0, -0.0, 1e-320, 1e-300, 1e-9, 1e30, 1e308, -1e308, f64::MAX]);
    let coordinate =
        prop_oneof![8 => (0..4i32).prop_map(|k| f64::from(k) * 0.01), 1 => -0.05..0.05, 1 => odd];
    let flat = any::<bool>();
    let point =
        (coordinate.clone(), coordinate.clone(), coordinate).prop_map(|(x, y, z)| DVec3::new(x, y, z));
    (prop::collection::vec([point.clone(), point.clone(), point], 1..12), flat).prop_map(
        |(mut triangles, flat)| {
            for corner in triangles.iter_mut().flatten().filter(|_| flat) {
                corner.z = 0.0;
            }
            triangles
        },
    )
}

fn all() -> Cells {
    [[true; SIDE]; SIDE]
}

#[test]
fn a_rectangle_is_four_corners_whatever_its_triangles() {
    let size = CELL * SIDE as f64;
    let low = corner(0, 0, 0.0).truncate();
    let expected = [low, low + DVec2::new(size, 0.0), low + DVec2::splat(size), low + DVec2::new(0.0, size)];
    let found = sheet(&flat(&all(), 0.1)).unwrap();
    let Outline::Polygon(corners) = &found.outline else { panic!("{found:?}") };
    for (corner, expected) in corners.iter().zip(expected) {
        assert!(corner.distance(expected) < 1e-15, "{corners:?}");
    }
    assert_eq!((corners.len(), found.z), (4, 0.1));
    assert_eq!(sheet(&plate(&all(), 0.099, 0.1)).unwrap(), found);
}

#[test]
fn a_sheet_with_two_sides_in_one_plane_is_a_sheet() {
    let front = flat(&all(), 0.0);
    let once = sheet(&front).unwrap();
    let back: Vec<Triangle> = front.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    assert_eq!(sheet(&[front.clone(), back].concat()).unwrap(), once);
    // The same from other triangles.
    let [a, b, c, d] = [[0, 0], [SIDE, 0], [SIDE, SIDE], [0, SIDE]].map(|[x, y]| corner(x, y, 0.0));
    let sides = [quad([a, b, c, d], false), quad([a, b, c, d], true).map(|[a, b, c]| [a, c, b])].concat();
    assert_eq!(sheet(&sides).unwrap(), once);
}

#[test]
fn what_is_no_thin_electrode_is_refused_with_a_reason() {
    let refused = |triangles: &[Triangle]| sheet(triangles).unwrap_err();
    let tilted: Vec<Triangle> =
        flat(&all(), 0.0).into_iter().map(|t| t.map(|v| v + DVec3::Z * (0.02 * v.x + 0.01))).collect();
    let error = refused(&tilted);
    let SheetError::NotFlat { low, high } = error else { panic!("{error}") };
    assert!((low - 0.0098).abs() < 1e-12 && (high - 0.0104).abs() < 1e-12, "{low} {high}");
    assert!(error.to_string().contains("spans z from 0.0098 m to 0.0104"), "{error}");
    let curved: Vec<Triangle> =
        flat(&all(), 0.0).into_iter().map(|t| t.map(|v| v + DVec3::Z * v.x * v.x)).collect();
    assert!(matches!(refused(&curved), SheetError::NotFlat { .. }));
    // Two levels joined by a slope, two sheets one above the other, and a plate with a step.
    let one = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
    let slope = quad(one.map(|v| DVec3::new(v.x, v.y, 0.01 * v.x)), false);
    assert!(matches!(refused(&slope), SheetError::NotFlat { .. }));
    let mut step = plate(&all(), 0.0, 3e-4);
    step.extend(flat(&all(), 1e-4));
    assert!(matches!(refused(&step), SheetError::NotFlat { .. }));
    let upright = quad([DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Z, DVec3::Z], false);
    assert_eq!(refused(&upright), SheetError::NotFlat { low: 0.0, high: 1.0 });
    let two = [flat(&all(), 0.0), flat(&all(), 1e-4)].concat();
    assert!(matches!(refused(&two), SheetError::NotClosed { edges: 48 }));
    let block = refused(&plate(&all(), 0.0, 0.004));
    let SheetError::TooThick { thickness: 0.004, width } = block else { panic!("{block}") };
    assert!((width - 0.03).abs() < 1e-12);
    let mut open = plate(&all(), 0.0, 3e-4);
    open.pop();
    assert_eq!(refused(&open), SheetError::NotClosed { edges: 3 });
}

#[test]
fn triangles_that_overlap_are_refused() {
    let refused = |triangles: &[Triangle]| sheet(triangles).unwrap_err();
    let triangle = |x: f64, y: f64, a: f64| {
        let at = DVec3::new(x, y, 0.0);
        [at, at + DVec3::X * a, at + DVec3::Y * a]
    };
    assert_eq!(refused(&[triangle(0.0, 0.0, 4.0), triangle(1.0, 1.0, 1.0)]), SheetError::Overlapping);
    assert_eq!(
        refused(&[triangle(0.0, 0.0, 4.0), triangle(1.0, 1.0, 9.0)]),
        SheetError::Outline("crosses itself")
    );
    let fan: Vec<Triangle> =
        (2..5).map(|k| [DVec3::ZERO, DVec3::X, DVec3::new(0.0, f64::from(k), 0.0)]).collect();
    assert_eq!(refused(&fan), SheetError::Overlapping);
    assert_eq!(
        refused(&[[DVec3::ZERO, DVec3::X, DVec3::X * 2.0]]),
        SheetError::Outline("has fewer than three corners")
    );
    let corners = [triangle(0.0, 0.0, 1.0), triangle(1.0, 0.0, 1.0)];
    assert_eq!(refused(&corners), SheetError::Touching { x: 1.0, y: 0.0 });
    assert_eq!(refused(&[[DVec3::ZERO; 3]]), SheetError::Outline("has fewer than three corners"));
}
