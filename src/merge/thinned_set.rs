//! Set in bounded memory, of what was found in any number of recordings.
//!
//! Up to a limit everything is kept. Beyond, time is divided into spans of 2^k ns, and poses into cells, with the least
//! k that leaves no more occupied cells than the limit. The greatest of a cell stands for all of it. What is kept is a
//! function of the set of all that was inserted, so that order, grouping and repetition change nothing.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use serde::{Deserialize, Serialize};

/// Member of a set.
pub trait Member {
    /// Cell of poses.
    type Pose: Clone + Ord;
    /// Most members that are kept.
    const MOST: usize;

    /// Start, ns.
    fn start(&self) -> i64;

    /// Cell of its pose.
    fn pose(&self) -> Self::Pose;

    /// Order by which the greater one stands for both; only equal members are equal in it.
    fn rank(&self, other: &Self) -> Ordering;
}

/// The members that are kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound(
    serialize = "T: Serialize, T::Pose: Serialize",
    deserialize = "T: Deserialize<'de>, T::Pose: Deserialize<'de>"
))]
pub struct ThinnedSet<T: Member> {
    /// Spans are 2^level ns long.
    level: u32,
    cells: BTreeMap<(i64, T::Pose), T>,
}

impl<T: Member> Default for ThinnedSet<T> {
    fn default() -> Self {
        Self { level: 0, cells: BTreeMap::new() }
    }
}

impl<T: Member> ThinnedSet<T> {
    /// Adds a member; one that is already there changes nothing.
    pub fn insert(&mut self, member: T) {
        self.put(member);
        while self.cells.len() > T::MOST && self.level < 63 {
            self.coarsen(self.level + 1);
        }
    }

    /// Adds the members of another set.
    pub fn join(&mut self, other: Self) {
        // What the other set could not keep apart cannot be kept apart here.
        if self.level < other.level {
            self.coarsen(other.level);
        }
        other.cells.into_values().for_each(|member| self.insert(member));
    }

    /// The members, in no particular order.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.cells.values()
    }

    /// Number of members that are kept.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Whether nothing is kept.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Whether some members stand for others.
    pub fn is_thinned(&self) -> bool {
        self.level > 0
    }

    fn coarsen(&mut self, level: u32) {
        self.level = level;
        let cells = std::mem::take(&mut self.cells);
        cells.into_values().for_each(|member| self.put(member));
    }

    fn put(&mut self, member: T) {
        match self.cells.entry((member.start() >> self.level, member.pose())) {
            Entry::Vacant(place) => drop(place.insert(member)),
            Entry::Occupied(mut place) => {
                if member.rank(place.get()) == Ordering::Greater {
                    place.insert(member);
                }
            }
        }
    }
}
