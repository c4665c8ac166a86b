//! Laws of the fit over the temperature, on simulated rests of a gyroscope.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::*;

/// Rests of a simulated session: placements, each with so many rests a minute apart, and the temperature at a time.
struct Session {
    placements: u32,
    rests: u32,
    celsius: fn(f64) -> f64,
    /// Scatter of the rests of a placement, and of placements, rad/s.
    scatter: [f64; 2],
}

/// An hour on a table, as a sensor warms after it was switched on.
const WARMING: Session = Session {
    placements: 1,
    rests: 40,
    celsius: |share| 22.0 + 34.0 * (1.0 - libm::exp(-4.0 * share)),
    scatter: [2e-5, 1e-4],
};
/// Six faces at each of three temperatures, up and down again, one rest each.
const CHAMBER: Session = Session {
    placements: 24,
    rests: 1,
    celsius: |share| [10.0, 45.0, 45.0, 25.0][(share * 4.0) as usize % 4],
    scatter: [2e-5, 1e-4],
};

impl Session {
    /// Readings of a bias that depends on temperature, °C, and on time as a share of the session.
    fn readings(&self, seed: u64, bias: impl Fn(f64, f64) -> Vector3<f64>) -> Vec<WarmReading> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = |std: f64| Vector3::from_fn(|_, _| std * random.sample::<f64, _>(StandardNormal));
        let count = self.placements * self.rests;
        let mut readings = Vec::new();
        for placement in 0..self.placements {
            let offset = normal(self.scatter[1]);
            for rest in 0..self.rests {
                let number = placement * self.rests + rest;
                let share = f64::from(number) / f64::from(count);
                let celsius = (self.celsius)(share);
                let noise = 3e-6;
                readings.push(WarmReading {
                    placement,
                    time: 60.0 * f64::from(number),
                    celsius,
                    mean: bias(celsius, share) + offset + normal(self.scatter[0]) + normal(noise),
                    noise: Vector3::repeat(noise * noise),
                });
            }
        }
        readings
    }

    fn learn(&self, seed: u64, bias: impl Fn(f64, f64) -> Vector3<f64>) -> Result<BiasCourse, Unclear> {
        let readings = self.readings(seed, bias);
        let last = readings.last().map_or(0.0, |reading| reading.celsius);
        learn(&readings, Between::Readings, HIGHEST, [1e-4, 1e-3], last)
    }
}

/// Change of bias from 30 °C: a slope on x, a parabola on y, nothing on z.
fn truth(celsius: f64) -> Vector3<f64> {
    let d = celsius - 30.0;
    Vector3::new(4e-5 * d, -2e-5 * d + 1.5e-6 * d * d, 0.0)
}

#[test]
fn what_the_temperature_does_is_found_and_the_intervals_hold() {
    for (name, session) in [("warming", WARMING), ("chamber", CHAMBER)] {
        let (mut inside, mut all, mut found) = (0, 0, 0);
        for seed in 0..300 {
            let Ok(course) = session.learn(seed, |celsius, _| truth(celsius)) else { continue };
            found += 1;
            for celsius in [12.0, 23.0, 35.0, 44.0] {
                let celsius = f64::clamp(celsius, course.range[0], course.range[1]);
                let error = course.change(celsius) - (truth(celsius) - truth(course.reference));
                let std = course.change_std(celsius);
                for axis in (0..3).filter(|axis| std[*axis] > 0.0) {
                    all += 1;
                    inside += usize::from(error[axis].abs() <= 1.96 * std[axis]);
                }
            }
        }
        let covered = 100.0 * f64::from(inside as u32) / f64::from(all as u32);
        assert!(found >= 285, "{name}: {found} of 300");
        assert!((93.0..99.5).contains(&covered), "{name}: {covered:.1} %");
    }
}

#[test]
fn the_order_is_no_higher_than_the_range_allows_and_the_bias_shows() {
    let narrow = Session { celsius: |share| 20.0 + 15.0 * share * share, ..WARMING };
    let course = narrow.learn(1, |celsius, _| truth(celsius)).unwrap();
    assert_eq!(course.order(), 1, "15 °C show a line");
    let orders: Vec<_> =
        (0..40).map(|seed| WARMING.learn(seed, |celsius, _| truth(celsius)).unwrap().order()).collect();
    assert!(orders.iter().filter(|order| **order == 2).count() >= 38, "{orders:?}");
    let line = |celsius: f64, _| Vector3::repeat(5e-5 * celsius);
    let orders: Vec<_> = (0..40).map(|seed| WARMING.learn(seed, line).unwrap().order()).collect();
    assert!(orders.iter().filter(|order| **order == 1).count() >= 38, "{orders:?}");
    let limited = learn(&WARMING.readings(3, |celsius, _| truth(celsius)), Between::Readings, 1, [1e-4, 1e-3], 50.0);
    assert_eq!(limited.unwrap().order(), 1);
}

#[test]
fn too_little_of_a_range_is_said() {
    let narrow = Session { celsius: |share| 20.0 + 8.0 * share, ..WARMING };
    let said = narrow.learn(1, |celsius, _| truth(celsius)).unwrap_err();
    assert!(
        matches!(said, Unclear::Span { range: [low, high] } if low == 20.0 && (27.0..28.0).contains(&high)),
        "{said:?}"
    );
    let few = Session { placements: 2, rests: 1, celsius: |share| 20.0 + 60.0 * share, ..WARMING };
    assert!(matches!(few.learn(1, |celsius, _| truth(celsius)), Err(Unclear::Few { .. })));
}

#[test]
fn a_bias_that_does_not_depend_on_the_temperature_is_seldom_said_to() {
    for session in [WARMING, CHAMBER] {
        let claimed = (0..400).filter(|seed| session.learn(*seed, |_, _| Vector3::zeros()).is_ok()).count();
        assert!(claimed <= 12, "{claimed} of 400");
    }
}

#[test]
fn a_drift_with_time_is_not_called_temperature() {
    let drift = |_, share: f64| Vector3::new(1e-3, -5e-4, 2e-4) * share;
    for celsius in [
        // As time, and as a sensor warms.
        |share: f64| 20.0 + 40.0 * share,
        |share: f64| 22.0 + 34.0 * (1.0 - libm::exp(-4.0 * share)),
        |share: f64| 20.0 + 30.0 * libm::sin(3.0 * share),
    ] {
        let session = Session { celsius, ..WARMING };
        let claimed = (0..100).filter(|seed| session.learn(*seed, drift).is_ok()).count();
        assert!(claimed <= 1, "{claimed} of 100");
    }
    // Nor can it be told which it was if the temperature rose as time does.
    let session = Session { celsius: |share| 20.0 + 40.0 * share, ..WARMING };
    assert!(matches!(
        session.learn(1, |celsius, _| truth(celsius)),
        Err(Unclear::Time { .. } | Unclear::Steady { .. })
    ));
}

#[test]
fn a_drift_beside_the_temperature_does_not_bend_it() {
    let both = |celsius: f64, share: f64| truth(celsius) + Vector3::new(3e-4, 0.0, 3e-4) * share;
    let (mut inside, mut found) = (0, 0);
    for seed in 0..200 {
        let Ok(course) = WARMING.learn(seed, both) else { continue };
        found += 1;
        let error = course.change(24.0) - (truth(24.0) - truth(course.reference));
        inside += usize::from(error.x.abs() <= 1.96 * course.change_std(24.0).x);
    }
    assert!(found >= 150 && inside as f64 >= 0.9 * found as f64, "{inside} of {found}");
}
