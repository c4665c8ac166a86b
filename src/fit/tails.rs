//! Tails of Fisher's F and of Student's t, as far out as alarms need them.

/// Most degrees of freedom that are told from a number known exactly.
const MANY: f64 = 1e5;

/// Probability that a ratio of mean squares with `above` and `below` degrees of freedom exceeds `ratio`.
pub fn fisher_beyond(ratio: f64, above: f64, below: f64) -> f64 {
    let (above, below) = (above.clamp(1.0, MANY), below.clamp(1.0, MANY));
    if ratio.is_nan() || ratio <= 0.0 {
        return 1.0;
    }
    let share = below / (below + above * ratio);
    incomplete_beta(below / 2.0, above / 2.0, share).clamp(0.0, 1.0)
}

/// Probability that a Student variable exceeds `t` on either side.
pub fn student_beyond(t: f64, freedom: f64) -> f64 {
    fisher_beyond(t * t, 1.0, freedom)
}

/// Regularised incomplete beta function (continued fraction of Lentz; Abramowitz and Stegun 26.5.8).
fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return if x <= 0.0 { 0.0 } else { 1.0 };
    }
    let log = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b) + a * libm::log(x) + b * libm::log1p(-x);
    if x < (a + 1.0) / (a + b + 2.0) {
        libm::exp(log) * fraction(a, b, x) / a
    } else {
        1.0 - libm::exp(log) * fraction(b, a, 1.0 - x) / b
    }
}

fn fraction(a: f64, b: f64, x: f64) -> f64 {
    const STEPS: u32 = 2000;
    const ENOUGH: f64 = 1e-13;
    let apart = |value: f64| if value.abs() < 1e-300 { 1e-300 } else { value };
    let (mut c, mut d) = (1.0, 1.0 / apart(1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = d;
    for step in 1..STEPS {
        let m = f64::from(step);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut last = 1.0;
        for term in [even, odd] {
            d = 1.0 / apart(1.0 + term * d);
            c = apart(1.0 + term / c);
            last = c * d;
            fraction *= last;
        }
        if (last - 1.0).abs() < ENOUGH {
            break;
        }
    }
    fraction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tails_are_those_of_the_tables() {
        for (t, freedom, expected) in [
            (1.959_964, f64::INFINITY, 0.05),
            (12.706, 1.0, 0.05),
            (2.4469, 6.0, 0.05),
            (9.0823, 6.0, 1e-4),
            (3.8906, 1e9, 1e-4),
        ] {
            let found = student_beyond(t, freedom);
            assert!((found / expected - 1.0).abs() < 3e-3, "{t} {freedom}: {found}");
        }
        for (ratio, above, below, expected) in [
            (2.9782, 10.0, 10.0, 0.05),
            (10.967, 4.0, 5.0, 0.0108),
            (11.0705 / 5.0, 5.0, f64::INFINITY, 0.05),
            (124.342 / 100.0, 100.0, f64::INFINITY, 0.05),
        ] {
            let found = fisher_beyond(ratio, above, below);
            assert!((found / expected - 1.0).abs() < 0.02, "{ratio} {above} {below}: {found}");
        }
        assert_eq!(fisher_beyond(0.0, 3.0, 4.0), 1.0);
    }
}
