//! The types of elements that a file may hold, by Gmsh's numbers (`GmshDefines.h`).

/// What an element is made of, whatever its order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Point,
    Line,
    Triangle,
    Tet,
}

impl Shape {
    pub(super) fn dimension(self) -> u8 {
        self.corners() as u8 - 1
    }

    pub(super) fn corners(self) -> usize {
        match self {
            Self::Point => 1,
            Self::Line => 2,
            Self::Triangle => 3,
            Self::Tet => 4,
        }
    }
}

/// A type of element whose corners are those of a simplex. They come first among its nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ElementType {
    pub(super) shape: Shape,
    /// Number of nodes: more than corners where the order is higher than the first.
    pub(super) nodes: usize,
}

impl ElementType {
    /// The type of that number, if it is made of points, lines, triangles or tetrahedra.
    pub(super) fn of(number: i64) -> Option<Self> {
        let (shape, nodes) = match number {
            15 => (Shape::Point, 1),
            1 => (Shape::Line, 2),
            8 => (Shape::Line, 3),
            26..=28 => (Shape::Line, number as usize - 22),
            2 => (Shape::Triangle, 3),
            9 => (Shape::Triangle, 6),
            20 => (Shape::Triangle, 9),
            21 => (Shape::Triangle, 10),
            22 => (Shape::Triangle, 12),
            23 | 24 => (Shape::Triangle, 15),
            25 => (Shape::Triangle, 21),
            4 => (Shape::Tet, 4),
            11 => (Shape::Tet, 10),
            29 => (Shape::Tet, 20),
            30 => (Shape::Tet, 35),
            31 => (Shape::Tet, 56),
            _ => return None,
        };
        Some(Self { shape, nodes })
    }

    pub(super) fn is_of_higher_order(self) -> bool {
        self.nodes > self.shape.corners()
    }
}

/// Name of an element type that is refused.
pub(super) fn type_name(number: i64) -> &'static str {
    match number {
        3 | 10 | 16 => "quadrangle",
        5 | 12 | 17 => "hexahedron",
        6 | 13 | 18 => "prism",
        7 | 14 | 19 => "pyramid",
        _ => "shape unknown here",
    }
}
