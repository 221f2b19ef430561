//! Vectors, matrices and rotations beside `NumPy` and `SciPy`, and their derivatives beside differences.

use fmu_solve::space::{Matrix, Quaternion, Vector};
use fmu_solve::{Dual, Number};

const A: Vector<f64> = Vector([1.0, -2.0, 0.5]);
const B: Vector<f64> = Vector([0.25, 3.0, -1.5]);
const M: Matrix<f64> = Matrix([[2.0, -1.0, 0.5], [0.0, 3.0, 1.0], [1.5, 0.25, -2.0]]);
const Q: [f64; 4] = [0.8, -0.2, 0.4, 0.4];
const P: [f64; 4] = [0.5, 0.5, -0.5, 0.5];

const DOT: f64 = -6.5;
const NORM: f64 = 2.291_287_847_477_92;
const CROSS: [f64; 3] = [1.5, 1.625, 3.5];
const TIMES_VECTOR: [f64; 3] = [4.25, -5.5, 0.0];
const SQUARE: [[f64; 3]; 3] = [[4.75, -4.875, -1.0], [1.5, 9.25, 1.0], [0.0, -1.25, 5.0]];
const DETERMINANT: f64 = -16.25;
/// Times 13.
const INVERSE: [[f64; 3]; 3] = [[5.0, 1.5, 2.0], [-1.2, 3.8, 1.6], [3.6, 1.6, -4.8]];
const ROTATED: [f64; 3] = [2.2, -0.4, -0.5];
const ROTATION: [[f64; 3]; 3] = [[0.36, -0.8, 0.48], [0.48, 0.6, 0.64], [-0.8, 0.0, 0.6]];
const PRODUCT: [f64; 4] = [0.5, 0.7, 0.1, 0.5];

/// A dozen operations on numbers up to 10.
const ROUND_OFF: f64 = 12.0 * 10.0 * f64::EPSILON;

fn assert_close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (one, other) in found.iter().zip(expected) {
        assert!((one - other).abs() <= ROUND_OFF, "{found:?} instead of {expected:?}");
    }
}

/// `A @ B`, `numpy.cross(A, B)`, `M @ A`, `M @ M`, `numpy.linalg.det(M)`, `numpy.linalg.inv(M)`.
#[test]
fn vectors_and_matrices_are_those_of_numpy() {
    assert_close(&[A.dot(B), A.norm()], &[DOT, NORM]);
    assert_close(&A.cross(B).0, &CROSS);
    assert_close(&(M * A).0, &TIMES_VECTOR);
    assert_close((M * M).0.as_flattened(), SQUARE.as_flattened());
    assert_close(&[M.determinant()], &[DETERMINANT]);
    assert_close(
        M.inverse().0.as_flattened(),
        INVERSE.map(|row| row.map(|number| number / 13.0)).as_flattened(),
    );
    assert_close((M.inverse() * M).0.as_flattened(), Matrix::diagonal([1.0; 3]).0.as_flattened());
}

/// `scipy.spatial.transform.Rotation.from_quat(Q, scalar_first=True)`: `apply(A)`, `as_matrix()`, and the product with
/// that of `P`.
#[test]
fn rotations_are_those_of_scipy() {
    let [q, p] = [Q, P].map(Quaternion::from_array);
    assert_close(&q.rotate(A).0, &ROTATED);
    assert_close(q.matrix().0.as_flattened(), ROTATION.as_flattened());
    assert_close(&(q * p).to_array(), &PRODUCT);
    assert_close(&(q * q.conjugate()).to_array(), &Quaternion::<f64>::identity().to_array());
    let longer = Quaternion::from_array(Q.map(|number| 2.0 * number));
    assert_close(&longer.normalized().to_array(), &Q);
    let axis = q.imaginary.normalized();
    assert_close(&Quaternion::about(axis, 2.0 * 0.8_f64.acos()).to_array(), &Q);
}

/// An attitude after a short time of constant angular velocity w in the body: q·exp(w t/2), whose derivative by the
/// time is the rate.
#[test]
fn the_rate_of_an_attitude_is_its_derivative() {
    let q = Quaternion::from_array(Q);
    let time = Dual::new(0.0, 1.0);
    let turned = Quaternion::about(Vector(B.normalized().0.map(Dual::from)), time * B.norm());
    let later = Quaternion::from_array(Q.map(Dual::from)) * turned;
    assert_close(&later.to_array().map(|number| number.derivative), &q.rate(B).to_array());
}

#[test]
fn derivatives_agree_with_differences() {
    fn evaluate<T: Number>(x: T) -> T {
        let vector = Vector([x, x * x, T::from(0.5)]);
        let matrix = Matrix([
            [x + 3.0, x * x, T::from(0.5)],
            [T::from(1.0), x + 4.0, -x],
            [x * 0.5, T::from(1.0), x - 5.0],
        ]);
        let rotation = Quaternion::from_array([x, T::from(0.3), x * x, T::from(-0.2)]).normalized();
        let turned = rotation.rotate(matrix.inverse() * vector) - rotation.matrix() * vector / x;
        (turned + -vector * x).norm() + matrix.determinant() + turned[1]
    }
    let (at, step) = (0.7, 1e-5);
    let expected = (evaluate(at + step) - evaluate(at - step)) / (2.0 * step);
    let found = evaluate(Dual::new(at, 1.0)).derivative;
    // A sixth of the step's square times the third derivative, below 1e3, and rounding divided by the step.
    assert!((found - expected).abs() < 3e-8, "{found} instead of {expected}");
}
