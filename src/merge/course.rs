//! History of a sensor in words and curves, for people.

use super::history::{Change, ChangeKind, History, Point};
use crate::plural::counted;
use crate::report::{Course, Curve, Jump, estimate, moment};

impl History {
    /// Course of the parameters, for a page or a terminal.
    pub fn course(&self) -> Course {
        let curve = |caption, of: &dyn Fn(&Point) -> Option<[[f64; 3]; 2]>| {
            let point = |point: &Point| of(point).map(|[value, std]| (point.time, value, std));
            Curve { caption, points: self.curve.iter().filter_map(point).collect() }
        };
        Course {
            notes: self.notes(),
            jumps: self.changes.iter().map(jump).collect(),
            curves: vec![
                curve("Accelerometer bias, m/s²", &|point| Some(point.bias)),
                curve("Accelerometer scale", &|point| Some(point.scale)),
                curve("Gyroscope bias, rad/s", &|point| point.gyro_bias),
            ],
        }
    }

    fn notes(&self) -> Vec<String> {
        let thinned = if self.is_thinned { ", of more the ones that stand for them" } else { "" };
        let number = |count: usize, noun| counted(count as u64, noun);
        let turns = match self.turns {
            0 => String::new(),
            turns => format!(", with {} between them", number(turns, "turn")),
        };
        let recordings = number(self.recordings, "recording");
        let merged = format!("{} of {recordings}{turns}{thinned}", number(self.rests, "rest"));
        let drifting = self.drifts.into_iter().zip(["accelerometer", "gyroscope"]).filter(|(drifts, _)| *drifts);
        let drifts = drifting.map(|(_, what)| {
            format!("the {what} drifts from recording to recording: the numbers are those of the end")
        });
        let overlapping = (self.overlapping > 0).then(|| {
            let rests = number(self.overlapping, "rest");
            format!(
                "{rests} began before another had ended, as one sensor cannot: these are several sensors, which --by tells apart \
                 (folder, frame-id, serial), or clocks that began anew. No number here is of one sensor"
            )
        });
        let strays = self.strays.iter().map(|wrong| {
            let when: Vec<_> = wrong.iter().map(|start| moment(*start)).collect();
            match when.as_slice() {
                [only] => {
                    format!("the rest at {only} contradicts all others: a wrong placement, and no change of the sensor")
                }
                _ => format!(
                    "one of the rests at {} is wrong: without it, all others agree. Place that face once more",
                    when.join(" and ")
                ),
            }
        });
        std::iter::once(merged).chain(overlapping).chain(strays).chain(drifts).collect()
    }
}

fn jump(change: &Change) -> Jump {
    let what = match change.kind {
        ChangeKind::Shock => "a shock",
        ChangeKind::Replaced => "another sensor or range",
        ChangeKind::Remounted => "remounted",
    };
    let turned = change.turned.map(|angle| format!("at rest it lies another way, by {:.0}°", angle.to_degrees()));
    if let (ChangeKind::Remounted, Some(turned)) = (change.kind, &turned) {
        return Jump { after: change.after, before: change.before, what: format!("{what}: {turned}") };
    }
    let numbers = |[by, std]: &[[f64; 3]; 2]| {
        let each = by.iter().zip(std).map(|(by, std)| estimate(*by, 1.96 * std));
        each.collect::<Vec<_>>().join("  ")
    };
    let mut what = format!("{what} ({:.0} σ): bias {} m/s²", change.score, numbers(&change.bias));
    if change.kind == ChangeKind::Replaced {
        what += &format!(", scale {}", numbers(&change.scale));
    }
    if let Some(gyro) = &change.gyro_bias {
        what += &format!(", gyroscope {} rad/s", numbers(gyro));
    }
    if let Some(turned) = turned {
        what += &format!("; {turned}");
    }
    Jump { after: change.after, before: change.before, what }
}
