//! Quantiles of Student's t and of the normal distribution, as far as intervals need them.

/// Half-width of a normal error's 95 % interval, in standard deviations.
pub(super) const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Half-width of a normal error's 99.9 % interval, in standard deviations.
pub(super) const NORMAL_999: f64 = 3.290_526_731_491_926;

/// Half-width of Student's 95 % interval.
pub(super) fn student_95(freedom: f64) -> f64 {
    student(freedom, 0.05, NORMAL_95)
}

/// Half-width of Student's 99.9 % interval.
pub(super) fn student_999(freedom: f64) -> f64 {
    student(freedom, 0.001, NORMAL_999)
}

/// Half-width of Student's interval with a two-sided tail probability of `tails`, to which `normal` is the half-width
/// for a normal error; by the expansion of Hill (1970), to four digits from two degrees of freedom on.
pub(super) fn student(freedom: f64, tails: f64, normal: f64) -> f64 {
    let n = freedom.max(2.0);
    if n > 1e6 {
        return normal;
    }
    let a = 1.0 / (n - 0.5);
    let b = 48.0 / (a * a);
    let mut c = ((20700.0 * a / b - 98.0) * a - 16.0) * a + 96.36;
    let d = ((94.5 / (b + c) - 3.0) / b + 1.0) * (a * std::f64::consts::FRAC_PI_2).sqrt() * n;
    let mut y = libm::pow(tails * d, 2.0 / n);
    if y > 0.05 + a {
        let x = -normal;
        y = x * x;
        if n < 5.0 {
            c += 0.3 * (n - 4.5) * (x + 0.6);
        }
        c += (((0.05 * d * x - 5.0) * x - 7.0) * x - 2.0) * x + b;
        y = (((((0.4 * y + 6.3) * y + 36.0) * y + 94.5) / c - y - 3.0) / b + 1.0) * x;
        y = libm::expm1(a * y * y);
    } else {
        let tail = 1.0 / (((n + 6.0) / (n * y) - 0.089 * d - 0.822) * (n + 2.0) * 3.0) + 0.5 / (n + 4.0);
        y = (tail * y - 1.0) * (n + 1.0) / (n + 2.0) + 1.0 / y;
    }
    (n * y).sqrt()
}

/// Quantile that a standard normal error exceeds on one side with a probability of `tail`, below a half (Abramowitz and
/// Stegun 26.2.23, within 4.5e-4).
pub(super) fn normal_beyond(tail: f64) -> f64 {
    let t = (-2.0 * libm::log(tail)).sqrt();
    t - (2.515_517 + t * (0.802_853 + t * 0.010_328)) / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantile_is_that_of_the_tables() {
        for (freedom, expected) in [(2.0, 4.3027), (3.0, 3.1824), (5.0, 2.5706), (10.0, 2.2281), (30.0, 2.0423)] {
            assert!((student_95(freedom) / expected - 1.0).abs() < 5e-4, "{freedom}: {}", student_95(freedom));
        }
        assert!((student_95(f64::INFINITY) - NORMAL_95).abs() < 1e-12);
        for (freedom, expected) in [(3.0, 12.924), (6.0, 5.9588), (12.0, 4.3178), (30.0, 3.6460)] {
            assert!((student_999(freedom) / expected - 1.0).abs() < 2e-3, "{freedom}: {}", student_999(freedom));
        }
        for (tail, expected) in [(0.05, 1.644_85), (0.01, 2.326_35), (1e-4, 3.719_02)] {
            assert!((normal_beyond(tail) - expected).abs() < 5e-4);
        }
    }
}
