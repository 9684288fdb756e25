//! A field on a structured grid with nodes at any coordinates.

/// `rows * columns` nodes with coordinates and a value each, row after row; node (r, c) is at `r * columns + c`.
///
/// Neighbours in (r, c) are corners of a cell; the coordinates are free, so speed lines of a map make rows.
/// A node with a NaN or infinite value or coordinate is unknown, and so are its cells.
#[derive(Debug, Clone, PartialEq)]
pub struct StructuredGrid {
    rows: usize,
    columns: usize,
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

/// A node: x, y in the axes' units, z in the field's.
pub(crate) type Node = [f64; 3];

impl StructuredGrid {
    /// Makes a grid of node coordinates `x`, `y` (units of the axes) and values `z`; `None` if one of them is not `rows * columns` long.
    pub fn new(rows: usize, columns: usize, x: Vec<f64>, y: Vec<f64>, z: Vec<f64>) -> Option<Self> {
        let nodes = rows.checked_mul(columns)?;
        [x.len(), y.len(), z.len()].iter().all(|count| *count == nodes).then_some(StructuredGrid {
            rows,
            columns,
            x,
            y,
            z,
        })
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Coordinates and value of a node; `None` if it is unknown or outside the grid.
    pub fn node(&self, row: usize, column: usize) -> Option<[f64; 3]> {
        if row >= self.rows || column >= self.columns {
            return None;
        }
        let at = row * self.columns + column;
        let node = [self.x[at], self.y[at], self.z[at]];
        node.iter().all(|v| v.is_finite()).then_some(node)
    }

    /// Smallest and largest known value.
    pub fn value_range(&self) -> Option<(f64, f64)> {
        self.known_nodes().fold(None, |range, node| match range {
            None => Some((node[2], node[2])),
            Some((low, high)) => Some((f64::min(low, node[2]), f64::max(high, node[2]))),
        })
    }

    pub(crate) fn known_nodes(&self) -> impl Iterator<Item = Node> + '_ {
        (0..self.rows).flat_map(move |r| (0..self.columns).filter_map(move |c| self.node(r, c)))
    }

    /// The corners (r, c), (r, c+1), (r+1, c+1), (r+1, c) of a cell, if all are known.
    pub(crate) fn cell(&self, row: usize, column: usize) -> Option<[Node; 4]> {
        Some([
            self.node(row, column)?,
            self.node(row, column + 1)?,
            self.node(row + 1, column + 1)?,
            self.node(row + 1, column)?,
        ])
    }
}
