//! Vectors, 3×3 matrices and rotations in space, for any [`Number`].
//!
//! A state, input or parameter that is an array becomes a vector by `Vector(array)`, and back by `.0`:
//!
//! ```
//! # use fmu_solve as fmu_export;
//! use fmu_export::space::{Quaternion, Vector};
//!
//! let attitude = Quaternion::about(Vector([0.0, 0.0, 1.0]), std::f64::consts::FRAC_PI_2);
//! let ahead = attitude.rotate(Vector([1.0, 0.0, 0.0]));
//! assert!((ahead - Vector([0.0, 1.0, 0.0])).norm() < 1e-15);
//! ```

use core::array;
use core::ops::{Add, AddAssign, Div, Index, IndexMut, Mul, Neg, Sub, SubAssign};

use crate::number::Number;

/// A vector of coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vector<T, const SIZE: usize = 3>(pub [T; SIZE]);

impl<T: Number, const SIZE: usize> Vector<T, SIZE> {
    /// The zero vector.
    #[must_use]
    pub fn zero() -> Self {
        Self([T::from(0.0); SIZE])
    }

    /// The scalar product.
    #[must_use]
    pub fn dot(self, other: Self) -> T {
        (0..SIZE).map(|index| self.0[index] * other.0[index]).sum()
    }

    /// The length. Its derivative at length 0 is infinite, as that of a root.
    #[must_use]
    pub fn norm(self) -> T {
        self.dot(self).sqrt()
    }

    /// The direction, with length 1; NaN without a length.
    #[must_use]
    pub fn normalized(self) -> Self {
        self / self.norm()
    }

    fn of(coordinate: impl FnMut(usize) -> T) -> Self {
        Self(array::from_fn(coordinate))
    }
}

impl<T: Number> Vector<T> {
    /// The vector product.
    #[must_use]
    pub fn cross(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }
}

impl<T, const SIZE: usize> Index<usize> for Vector<T, SIZE> {
    type Output = T;

    fn index(&self, index: usize) -> &T {
        &self.0[index]
    }
}

impl<T, const SIZE: usize> IndexMut<usize> for Vector<T, SIZE> {
    fn index_mut(&mut self, index: usize) -> &mut T {
        &mut self.0[index]
    }
}

impl<T: Number, const SIZE: usize> Neg for Vector<T, SIZE> {
    type Output = Self;

    fn neg(self) -> Self {
        Self(self.0.map(Neg::neg))
    }
}

impl<T: Number, const SIZE: usize> Add for Vector<T, SIZE> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::of(|index| self[index] + other[index])
    }
}

impl<T: Number, const SIZE: usize> AddAssign for Vector<T, SIZE> {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<T: Number, const SIZE: usize> Sub for Vector<T, SIZE> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self::of(|index| self[index] - other[index])
    }
}

impl<T: Number, const SIZE: usize> SubAssign for Vector<T, SIZE> {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<T: Number, const SIZE: usize> Mul<T> for Vector<T, SIZE> {
    type Output = Self;

    fn mul(self, factor: T) -> Self {
        Self(self.0.map(|coordinate| coordinate * factor))
    }
}

impl<T: Number, const SIZE: usize> Div<T> for Vector<T, SIZE> {
    type Output = Self;

    fn div(self, divisor: T) -> Self {
        Self(self.0.map(|coordinate| coordinate / divisor))
    }
}

/// A 3×3 matrix, by rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matrix<T>(pub [[T; 3]; 3]);

impl<T: Number> Matrix<T> {
    /// The matrix with these numbers on the diagonal, and zeros elsewhere.
    #[must_use]
    pub fn diagonal(numbers: [T; 3]) -> Self {
        Self::of(|row, column| if row == column { numbers[row] } else { T::from(0.0) })
    }

    /// Rows and columns exchanged.
    #[must_use]
    pub fn transposed(self) -> Self {
        Self::of(|row, column| self.0[column][row])
    }

    /// The determinant.
    #[must_use]
    pub fn determinant(self) -> T {
        let [a, b, c] = self.0.map(Vector);
        a.dot(b.cross(c))
    }

    /// The inverse; its numbers are infinite or NaN if there is none.
    #[must_use]
    pub fn inverse(self) -> Self {
        let [a, b, c] = self.0.map(Vector);
        let columns = [b.cross(c), c.cross(a), a.cross(b)];
        let determinant = a.dot(columns[0]);
        Self(columns.map(|column| (column / determinant).0)).transposed()
    }

    fn of(number: impl Fn(usize, usize) -> T) -> Self {
        Self(array::from_fn(|row| array::from_fn(|column| number(row, column))))
    }
}

impl<T: Number> Mul<Vector<T>> for Matrix<T> {
    type Output = Vector<T>;

    fn mul(self, vector: Vector<T>) -> Vector<T> {
        Vector(self.0.map(|row| Vector(row).dot(vector)))
    }
}

impl<T: Number> Mul for Matrix<T> {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let columns = other.transposed();
        Self::of(|row, column| Vector(self.0[row]).dot(Vector(columns.0[column])))
    }
}

/// A quaternion, of length 1 for a rotation: the one from body to reference coordinates, if it is an attitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quaternion<T> {
    /// The real part, the cosine of half the angle.
    pub real: T,
    /// The imaginary part, the axis times the sine of half the angle.
    pub imaginary: Vector<T>,
}

impl<T: Number> Quaternion<T> {
    /// No rotation.
    #[must_use]
    pub fn identity() -> Self {
        Self { real: T::from(1.0), imaginary: Vector::zero() }
    }

    /// The rotation about an axis of length 1 by an angle in radians.
    #[must_use]
    pub fn about(axis: Vector<T>, angle: T) -> Self {
        let (sine, cosine) = (angle * 0.5).sin_cos();
        Self { real: cosine, imaginary: axis * sine }
    }

    /// The quaternion of four numbers, the real part first, as states have them.
    #[must_use]
    pub fn from_array([real, x, y, z]: [T; 4]) -> Self {
        Self { real, imaginary: Vector([x, y, z]) }
    }

    /// The quaternion's four numbers, the real part first.
    #[must_use]
    pub fn to_array(self) -> [T; 4] {
        let [x, y, z] = self.imaginary.0;
        [self.real, x, y, z]
    }

    /// The opposite rotation, if its length is 1.
    #[must_use]
    pub fn conjugate(self) -> Self {
        Self { imaginary: -self.imaginary, ..self }
    }

    /// The quaternion with length 1: integration lets the length of an attitude drift.
    #[must_use]
    pub fn normalized(self) -> Self {
        let numbers = Vector(self.to_array());
        Self::from_array(numbers.normalized().0)
    }

    /// A vector rotated, if the length is 1.
    #[must_use]
    pub fn rotate(self, vector: Vector<T>) -> Vector<T> {
        let twice = self.imaginary.cross(vector) * T::from(2.0);
        vector + twice * self.real + self.imaginary.cross(twice)
    }

    /// The matrix that rotates vectors alike.
    #[must_use]
    pub fn matrix(self) -> Matrix<T> {
        let axes = Matrix::diagonal([T::from(1.0); 3]).0;
        Matrix(axes.map(|axis| self.rotate(Vector(axis)).0)).transposed()
    }

    /// The derivative of an attitude by time, given the angular velocity in body coordinates (rad/s).
    #[must_use]
    pub fn rate(self, angular_velocity: Vector<T>) -> Self {
        self * Self { real: T::from(0.0), imaginary: angular_velocity * T::from(0.5) }
    }
}

/// The product of two quaternions: the rotation by the second, then by the first.
impl<T: Number> Mul for Quaternion<T> {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let ((r, v), (s, w)) = ((self.real, self.imaginary), (other.real, other.imaginary));
        Self { real: r * s - v.dot(w), imaginary: w * r + v * s + v.cross(w) }
    }
}
