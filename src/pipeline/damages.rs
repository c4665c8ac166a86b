//! Damages of a recording, split by split.
//!
//! The copy in an annotated recording may be whole where the original was cut off or damaged. Of each split the damages
//! of the file or those of the original in it count, whichever are more.

use crate::record::Damage;

/// Number of damages listed one by one.
const LISTED: u64 = 10;

/// Damages so far.
#[derive(Debug, Default)]
pub(crate) struct Damages {
    splits: Vec<OfSplit>,
}

/// Damages of one split.
#[derive(Debug, Default)]
struct OfSplit {
    /// The first of them.
    listed: Vec<Damage>,
    count: u64,
}

impl Damages {
    /// Adds a damage of the split with this index.
    pub(crate) fn add(&mut self, split: usize, damage: Damage) {
        if self.splits.len() <= split {
            self.splits.resize_with(split + 1, OfSplit::default);
        }
        if let Some(of) = self.splits.get_mut(split) {
            of.count += 1;
            if of.count <= LISTED {
                of.listed.push(damage);
            }
        }
    }

    /// Takes the damages of others in place of these for each split that has more of them.
    pub(crate) fn or_more(&mut self, others: Self) {
        self.splits.resize_with(self.splits.len().max(others.splits.len()), OfSplit::default);
        for (mine, theirs) in self.splits.iter_mut().zip(others.splits) {
            if theirs.count > mine.count {
                *mine = theirs;
            }
        }
    }

    /// Number of damages.
    pub(crate) fn count(&self) -> u64 {
        self.splits.iter().map(|of| of.count).sum()
    }

    /// The first damage.
    pub(crate) fn first(&self) -> Option<&Damage> {
        self.splits.iter().find_map(|of| of.listed.first())
    }

    /// The first damages, one a line, and how many there are if there are more.
    pub(crate) fn lines(&self) -> Vec<String> {
        let listed = self.splits.iter().flat_map(|of| &of.listed).take(LISTED as usize);
        let mut lines: Vec<_> = listed.map(|damage| format!("damaged {damage}")).collect();
        if self.count() > LISTED {
            lines.push(format!("{} damages in all", self.count()));
        }
        lines
    }
}
