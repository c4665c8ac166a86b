//! Error of a corrected reading at rest, in every direction of gravity at once and in the worst one.

use nalgebra::{DMatrix, Matrix3, Matrix4, Vector3, Vector4};

use super::calibration::Calibration;
use super::parameterisation::{Parameterisation, Term};
use super::student_t::normal_beyond;

/// Covariance of the error of a corrected reading as a function of direction: with h = (1, true specific force), each entry
/// is `hᵀ M h`, with a matrix M of its own.
#[derive(Clone, Debug)]
pub struct ReadingError {
    /// Of each of the [`ENTRIES`], the factors of the [`PRODUCTS`] of (1, direction).
    forms: [[f64; PRODUCTS.len()]; ENTRIES.len()],
    /// Number of unknowns of the model.
    parts: usize,
}

/// Entries of a symmetric matrix of three rows.
const ENTRIES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
/// Products of two of four numbers.
const PRODUCTS: [(usize, usize); 10] = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];

impl ReadingError {
    /// Builds the covariance from that of the parameters and from two standard deviations: of each entry of S that the
    /// shape leaves out, and of each off-diagonal entry that the triad it was compared with leaves out.
    pub fn new(
        shape: Parameterisation,
        covariance: &DMatrix<f64>,
        inverse: Matrix3<f64>,
        [unmodelled, inherited]: [f64; 2],
        gravity: f64,
    ) -> Self {
        let mut forms = [[Matrix4::zeros(); 3]; 3];
        // At rest a term multiplies one entry of h; the other quantity adds nothing.
        let place = |term: &Term| match *term {
            Term::Bias(axis) => Some((axis, 0)),
            Term::Own(axis, column) => Some((axis, 1 + column)),
            Term::Other(..) | Term::Square(_) => None,
        };
        for (k, first) in shape.terms().iter().enumerate() {
            for (l, second) in shape.terms().iter().enumerate() {
                if let (Some((i, a)), Some((j, b))) = (place(first), place(second)) {
                    forms[i][j][(a, b)] += covariance[(k, l)];
                }
            }
        }
        for (axis, column) in shape.unmodelled().filter_map(|term| place(&term)) {
            forms[axis][axis][(column, column)] += unmodelled * unmodelled;
        }
        for (axis, column) in Parameterisation::DIAGONAL.unmodelled().filter_map(|term| place(&term)) {
            forms[axis][axis][(column, column)] += inherited * inherited;
        }
        // δ(S⁻¹(m − b)) = −S⁻¹ ∂measured/∂parameters δparameters.
        let corrected = |i: usize, j: usize| -> Matrix4<f64> {
            (0..3)
                .flat_map(|k| (0..3).map(move |l| (k, l)))
                .map(|(k, l)| forms[k][l] * (inverse[(i, k)] * inverse[(j, l)]))
                .sum()
        };
        let forms = ENTRIES.map(|(i, j)| {
            let form = corrected(i, j);
            let unit = Vector4::new(1.0, gravity, gravity, gravity);
            PRODUCTS.map(|(a, b)| unit[a] * unit[b] * if a == b { form[(a, a)] } else { form[(a, b)] + form[(b, a)] })
        });
        Self { forms, parts: shape.unknowns() }
    }

    /// Covariance of the corrected reading while true specific force points along the unit vector `up`, (m/s²)².
    pub fn covariance(&self, up: &Vector3<f64>) -> Matrix3<f64> {
        let h = Vector4::new(1.0, up.x, up.y, up.z);
        let products = PRODUCTS.map(|(a, b)| h[a] * h[b]);
        let [xx, xy, xz, yy, yz, zz] =
            self.forms.map(|form| form.iter().zip(&products).map(|(factor, product)| factor * product).sum());
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    }

    /// Bound of the length of the error in all directions at once with a probability of 95 %, m/s². The error has as
    /// many independent parts as the model has unknowns, and each must stay within the bound (Šidák 1967).
    pub fn worst(&self) -> f64 {
        let tail = 1.0 - libm::pow(0.95, 1.0 / self.parts as f64);
        self.summit(normal_beyond(tail))
    }

    /// Bound of the length of the error with a probability of 95 %, in the direction where it is largest, m/s².
    pub fn worst_direction(&self) -> f64 {
        self.summit(normal_beyond(0.05))
    }

    fn summit(&self, normal: f64) -> f64 {
        let reach = |up: &Vector3<f64>| length(&self.covariance(up), normal);
        let mut starts: Vec<_> = directions().map(|up| (reach(&up), up)).collect();
        starts.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        starts.truncate(3);
        starts.into_iter().map(|(start, up)| climb(start, up, &reach)).fold(0.0, f64::max)
    }
}

/// Climbs from a direction to the nearest maximum, in ever smaller steps.
fn climb(start: f64, from: Vector3<f64>, height: &impl Fn(&Vector3<f64>) -> f64) -> f64 {
    /// First and last step, radians.
    const FIRST: f64 = 0.4;
    const LAST: f64 = 0.002;
    let (mut best, mut up, mut step) = (start, from, FIRST);
    while step > LAST {
        let east = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
        let north = up.cross(&east);
        let (sin, cos) = libm::sincos(step);
        let around = [east, -east, north, -north].map(|aside| up * cos + aside * sin);
        let highest = around.iter().map(|up| (height(up), up)).max_by(|(a, _), (b, _)| a.total_cmp(b));
        match highest {
            Some((higher, there)) if higher > best => (best, up) = (higher, *there),
            _ => step /= 2.0,
        }
    }
    best
}

/// Largest error of a corrected reading while the parameters are off by `off`, m/s².
pub(super) fn most(inverse: &Matrix3<f64>, off: &Calibration, gravity: f64) -> f64 {
    (inverse * off.bias).norm() + gravity * (inverse * off.sensitivity).norm()
}

/// Quantile of the length of a normal vector with this covariance; `normal` is that of a standard normal number. The
/// squared length is taken for a scaled χ² of the same mean and variance (Satterthwaite 1946), with the quantile of
/// Wilson and Hilferty (1931). Accurate within 2 %.
fn length(covariance: &Matrix3<f64>, normal: f64) -> f64 {
    let mean = covariance.trace();
    let spread = covariance.norm_squared();
    if mean.is_nan() || mean <= 0.0 || spread <= 0.0 {
        return mean.max(0.0).sqrt();
    }
    let freedom = mean * mean / spread;
    let v = 2.0 / (9.0 * freedom);
    (mean * (1.0 - v + normal * v.sqrt()).powi(3)).sqrt()
}

/// Directions of the faces, edges and corners of a cube.
pub fn directions() -> impl Iterator<Item = Vector3<f64>> {
    let axis = [-1.0, 0.0, 1.0];
    axis.into_iter()
        .flat_map(move |x| axis.into_iter().flat_map(move |y| axis.into_iter().map(move |z| Vector3::new(x, y, z))))
        .filter_map(|direction: Vector3<f64>| direction.try_normalize(0.5))
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::super::parameterisation::Truth;
    use super::*;

    const G: f64 = 9.8;

    /// Random covariance, and its root, which makes errors out of normal numbers.
    fn any(shape: Parameterisation, random: &mut ChaCha8Rng) -> (DMatrix<f64>, DMatrix<f64>) {
        let n = shape.unknowns();
        let root = DMatrix::from_fn(n, n, |row, _| {
            let unit = if matches!(shape.terms()[row], Term::Bias(_)) { 1.0 } else { 1.0 / G };
            0.01 * unit * random.sample::<f64, _>(StandardNormal)
        });
        (&root * root.transpose(), root)
    }

    #[test]
    fn no_direction_is_worse_than_the_worst() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for round in 0..40 {
            let shape = [Parameterisation::DIAGONAL, Parameterisation::TRIANGULAR, Parameterisation::MATRIX][round % 3];
            let (covariance, _) = any(shape, &mut random);
            let inverse = Matrix3::identity() + Matrix3::from_fn(|_, _| 0.05 * random.sample::<f64, _>(StandardNormal));
            let error = ReadingError::new(shape, &covariance, inverse, [0.001 * (round % 2) as f64, 0.0], G);
            let found = error.worst();
            let mut worst = 0.0_f64;
            for _ in 0..4000 {
                let up = Vector3::from_fn(|_, _| random.sample::<f64, _>(StandardNormal)).normalize();
                worst = worst.max(length(
                    &error.covariance(&up),
                    normal_beyond(1.0 - libm::pow(0.95, 1.0 / shape.unknowns() as f64)),
                ));
            }
            assert!(found > 0.999 * worst && found < 1.02 * worst, "{shape:?}: {found} {worst}");
        }
    }

    #[test]
    fn the_worst_error_is_kept_to_as_often_as_it_says() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        for shape in [Parameterisation::DIAGONAL, Parameterisation::MATRIX] {
            let (covariance, root) = any(shape, &mut random);
            let error = ReadingError::new(shape, &covariance, Matrix3::identity(), [0.0; 2], G);
            let bound = error.worst();
            let ups: Vec<_> = (0..200)
                .map(|_| Vector3::from_fn(|_, _| random.sample::<f64, _>(StandardNormal)).normalize())
                .collect();
            const DRAWS: u32 = 4000;
            let kept = (0..DRAWS).filter(|_| {
                let off = &root * DVector::from_fn(root.ncols(), |_, _| random.sample::<f64, _>(StandardNormal));
                ups.iter().all(|up| (shape.jacobian(&Truth::of(up * G)) * &off).norm() <= bound)
            });
            let kept = 100.0 * kept.count() as f64 / f64::from(DRAWS);
            assert!((95.0..99.8).contains(&kept), "{shape:?}: {kept} % in every direction");
        }
    }
}
