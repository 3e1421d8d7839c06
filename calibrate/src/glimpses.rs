//! What pictures showed when they did not show the board that was asked for.

use std::collections::BTreeMap;

use crate::board::BoardSize;
use crate::corners::Glimpse;

/// What all pictures showed together.
#[derive(Debug, Clone, Default)]
pub struct Glimpses {
    /// The picture that showed most, and its name.
    best: Option<(String, Glimpse)>,
    /// How often a grid of each size was seen; the longer side first.
    spans: BTreeMap<(usize, usize), usize>,
}

impl Glimpses {
    /// Adds a picture.
    pub fn add(&mut self, name: &str, glimpse: Glimpse) {
        let rank = |g: &Glimpse| (g.span.0 * g.span.1, g.junctions);
        if self.best.as_ref().is_none_or(|(_, best)| rank(&glimpse) > rank(best)) {
            self.best = Some((name.to_owned(), glimpse));
        }
        if glimpse.span != (0, 0) {
            *self.spans.entry(sorted(glimpse.span)).or_default() += 1;
        }
    }

    /// What the picture that came nearest to a board showed.
    #[must_use]
    pub fn nearest(&self) -> String {
        let Some((name, glimpse)) = &self.best else { return "There was no picture.".to_owned() };
        let seen = match (glimpse.span, glimpse.junctions) {
            ((0, 0), 0) => format!("nothing that looks like a corner of squares; its mean grey level is {:.0} of 255", glimpse.grey),
            ((0, 0), count) => {
                format!("{count} places that may be corners, and no grid; its mean grey level is {:.0} of 255", glimpse.grey)
            }
            ((columns, rows), _) => format!("a grid of {columns} x {rows} corners"),
        };
        format!("The one that showed most, {name}, has {seen}.")
    }

    /// The size of most grids, if it is not the board's. Whole lines of corners are missed now and then, but not the same ones each time.
    #[must_use]
    pub fn other_size(&self, board: BoardSize) -> Option<(usize, usize)> {
        let all: usize = self.spans.values().sum();
        let (&span, &count) = self.spans.iter().max_by_key(|(_, count)| **count)?;
        (2 * count > all && span != sorted((board.columns, board.rows))).then_some(span)
    }
}

fn sorted((a, b): (usize, usize)) -> (usize, usize) {
    (a.max(b), a.min(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_to_a_board_is_named_and_another_size_is_noticed() {
        let glimpse = |span, junctions| Glimpse { junctions, span, grey: 90.0 };
        let mut seen = Glimpses::default();
        seen.add("a.png", glimpse((0, 0), 0));
        assert!(seen.nearest().contains("a.png") && seen.nearest().contains("grey level is 90"), "{}", seen.nearest());
        seen.add("b.png", glimpse((0, 0), 7));
        assert!(seen.nearest().contains("b.png, has 7 places"), "{}", seen.nearest());
        seen.add("c.png", glimpse((5, 8), 40));
        seen.add("d.png", glimpse((8, 5), 40));
        seen.add("e.png", glimpse((8, 4), 32));
        assert!(seen.nearest().contains("c.png, has a grid of 5 x 8"), "{}", seen.nearest());
        assert_eq!(seen.other_size(BoardSize { columns: 9, rows: 6 }), Some((8, 5)));
        assert_eq!(seen.other_size(BoardSize { columns: 5, rows: 8 }), None);
    }
}
