//! Fleets of simulated sensors whose recordings show a face or a few each: what merging them comes to.

use super::fleet::{Outcome, Population, SCATTER, Score, USUAL};
use super::{Seeds, each};

/// Rows of the table; the first is that of the target.
const ROWS: [Population; 12] = [
    USUAL,
    Population { name: "no shocks", shock: [0.0, 0.0], ..USUAL },
    Population { name: "no drift", drift: 0.0, ..USUAL },
    Population { name: "drift of half a scatter", drift: 0.5 * SCATTER, ..USUAL },
    Population { name: "drift of six scatters", drift: 6.0 * SCATTER, shock: [10.0, 30.0], ..USUAL },
    Population { name: "a third of the scatter", scatter: 1.0 / 3.0, ..USUAL },
    Population { name: "three times the scatter", scatter: 3.0, shock: [9.0, 30.0], ..USUAL },
    Population { name: "scatter common by half", common: 0.5, ..USUAL },
    Population { name: "one face", faces: [1, 1], ..USUAL },
    Population { name: "three to six faces", faces: [3, 6], ..USUAL },
    Population { name: "15 recordings", recordings: 15, shock: [0.0, 0.0], ..USUAL },
    Population { name: "200 recordings", recordings: 200, ..USUAL },
];

/// Prints the table; whether its first row meets the target.
pub fn fleets(seeds: Seeds, part: &str) -> bool {
    println!(
        "\nFleets, a sensor each of {seeds} a line: error over its Cramér–Rao bound / coverage of 95 % intervals\n"
    );
    let names = ["accel bias", "accel scale", "gyro bias"];
    print!("{:26} {:>10}", "", "calibrated");
    names.iter().for_each(|name| print!(" {name:>17}"));
    println!(" {:>9} {:>18}", "found", "false alarms/1,000");
    let mut met = true;
    for population in ROWS.iter().filter(|population| population.name.contains(part)) {
        let outcomes = each(seeds, |seed| population.sensor(seed));
        let errors: Vec<_> = outcomes.iter().filter_map(Outcome::errors).collect();
        let calibrated = errors.len() as f64 / outcomes.len() as f64;
        print!("{:26} {:>8.1} %", population.name, 100.0 * calibrated);
        let is_target = population.name == USUAL.name;
        for triple in 0..names.len() {
            let score = Score::of(errors.iter().flat_map(|errors| errors[triple]));
            print!(" {:>17}", format!("{:.3} / {:.1} %", score.over_bound, 100.0 * score.covered));
            met &= !is_target || score.over_bound <= 1.15 && (0.93..=0.97).contains(&score.covered);
        }
        let shaken: Vec<_> = outcomes.iter().filter(|outcome| outcome.shock.is_some()).collect();
        let found = shaken.iter().filter(|outcome| outcome.is_found()).count() as f64 / shaken.len() as f64;
        let alarms: usize = outcomes.iter().map(Outcome::false_alarms).sum();
        let alarms = 1000.0 * alarms as f64 / (outcomes.len() as f64 * population.recordings as f64);
        let found_text = if shaken.is_empty() { String::new() } else { format!("{:.1} %", 100.0 * found) };
        println!(" {found_text:>9} {alarms:>18.2}");
        met &= !is_target || calibrated >= 0.95 && found >= 0.95 && alarms <= 1.0;
    }
    met
}
