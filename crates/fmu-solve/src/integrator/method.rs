//! The integrator's linearly implicit (Rosenbrock) methods, as tables.
//!
//! A step of length h from x at t solves, for each stage i, with A the Jacobian or an approximation,
//!
//! ```text
//! (1/(γ·h) − A)·uᵢ = f(t + τᵢ·h, x + Σⱼ aᵢⱼ·uⱼ) + Σⱼ cᵢⱼ/h·uⱼ + gᵢ·h·∂f/∂t,   j < i.
//! ```
//!
//! The result of the step is where the last stage evaluates f plus that stage.

use super::explicit;

/// A method's coefficients.
#[derive(Debug)]
pub struct Method {
    pub(super) gamma: f64,
    /// a: the weights of the stages in the states at which each stage is evaluated.
    pub(super) states: &'static [&'static [f64]],
    /// c: the weights of the stages on the right-hand side of each stage.
    pub(super) stages: &'static [&'static [f64]],
    /// τ: the time of each stage within the step, relative to it.
    pub(super) times: &'static [f64],
    /// g: the weight of the derivative with respect to time in each stage.
    pub(super) by_time: &'static [f64],
    /// The weights of the last stages in the estimated error.
    pub(super) error: &'static [f64],
    /// The order of the estimate: the slope of its logarithm over that of the step.
    pub(super) estimate_order: f64,
    /// The weights of the stages in the polynomials of the dense output; without, it is the cubic through states and
    /// derivatives at both ends.
    pub(super) dense: &'static [&'static [f64]],
    /// Whether the order holds with any matrix in place of the Jacobian, which then serves many steps.
    pub(super) takes_any_jacobian: bool,
    /// The phases in which the explicit method takes the place of this one.
    pub(super) explicit: Phases,
}

/// Phases of an integration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phases {
    None,
    Nonstiff,
    All,
}

impl Method {
    /// The most states whose linear equations are always dense: about where both take equally long for random networks,
    /// as the experiment `chosen_sizes` prints; more where a Jacobian serves many steps, which would not repay the code that
    /// finds its pattern.
    #[must_use]
    pub const fn most_dense(&self) -> usize {
        if self.takes_any_jacobian { 20 } else { 8 }
    }

    /// The number of stages that need memory.
    pub(super) const fn count(&self) -> usize {
        if self.has_explicit() { explicit::STAGES } else { self.stages.len() }
    }

    /// Whether the explicit method may take steps.
    pub(super) const fn has_explicit(&self) -> bool {
        !matches!(self.explicit, Phases::None)
    }

    /// Whether the explicit method and the linearly implicit one take turns.
    pub(super) const fn switches(&self) -> bool {
        matches!(self.explicit, Phases::Nonstiff)
    }

    /// Whether the explicit method takes the next step, where the linearly implicit one would if they take turns.
    pub(super) const fn is_explicit(&self, is_implicit: bool) -> bool {
        match self.explicit {
            Phases::None => false,
            Phases::Nonstiff => !is_implicit,
            Phases::All => true,
        }
    }
}

/// `DOP853` in nonstiff phases, `Rodas5P` in stiff ones, as they turn out.
pub const AUTOMATIC: Method = Method { explicit: Phases::Nonstiff, ..RODAS5P };

/// `DOP853` alone: explicit, of eighth order, for systems that are never stiff.
pub const DOP853: Method = Method { explicit: Phases::All, ..RODAS5P };

/// `Rodas5P`: fifth order with an embedded method of fourth order and dense output of fourth order, eight stages
/// (Steinebach, Construction of Rosenbrock-Wanner method `Rodas5P` and numerical benchmarks within the Julia
/// Differential Equations package, BIT Numerical Mathematics 63, 2023).
///
/// It is L-stable. Its order, high enough for non-stiff systems, rests on exact Jacobians, from dual numbers.
pub const RODAS5P: Method = Method {
    gamma: GAMMA,
    states: &A,
    stages: &C,
    times: &TIMES,
    by_time: &TIME_DERIVATIVE,
    error: &[1.0],
    estimate_order: 5.0,
    dense: &DENSE,
    takes_any_jacobian: false,
    explicit: Phases::None,
};

/// `ROS34PW2`: third order with an embedded method of second order, four stages (Rang and Angermann, New Rosenbrock
/// W-methods of order 3 for partial differential algebraic equations of index 1, BIT Numerical Mathematics 45, 2005).
///
/// It is L-stable. As a W-method it keeps its order with any matrix in place of the Jacobian, which so serves many
/// steps.
pub const ROS34PW2: Method = Method {
    gamma: 0.435_866_521_508_459,
    // The printed coefficients (α, Γ, b) for the sums u = Γ·k instead of k: α·Γ⁻¹, 1/γ − Γ⁻¹ and (b − b̂)·Γ⁻¹.
    states: &[
        &[],
        &[2.0],
        &[1.419_217_317_455_764_7, -0.259_232_211_672_969_7],
        &[4.184_760_482_319_16, -0.285_192_017_355_495_9, 2.294_280_360_279_042],
    ],
    stages: &[
        &[],
        &[-4.588_560_720_558_084],
        &[-4.184_760_482_319_16, 0.285_192_017_355_495_9],
        &[-6.368_179_200_128_358, -6.795_620_944_466_835, 2.870_098_604_331_056],
    ],
    times: &[0.0, 0.871_733_043_016_918, 0.731_579_957_788_852_4, 1.0],
    by_time: &[0.435_866_521_508_459, -0.435_866_521_508_459, -0.413_333_376_233_886_5, 0.0],
    error: &[0.277_749_947_647_967_95, -1.403_239_895_175_999, 1.772_630_127_667_550_6, 0.5],
    estimate_order: 3.0,
    dense: &[],
    takes_any_jacobian: true,
    explicit: Phases::None,
};

/// γ of `Rodas5P`.
const GAMMA: f64 = 0.211_937_563_194_290_14;

/// The weights a of `Rodas5P`; rows after the sixth are the sixth, followed by ones.
const A: [&[f64]; 8] = [
    &[],
    &[3.0],
    &[2.849_394_379_747_939, 0.458_422_422_044_639_23],
    &[-6.954_028_509_809_101, 2.489_845_061_869_568, -10.358_996_098_473_584],
    &[2.802_998_627_562_896_4, 0.507_246_473_622_820_6, -0.398_831_254_177_052_4, -0.047_211_872_304_046_41],
    &SIXTH,
    &[SIXTH[0], SIXTH[1], SIXTH[2], SIXTH[3], SIXTH[4], 1.0],
    &[SIXTH[0], SIXTH[1], SIXTH[2], SIXTH[3], SIXTH[4], 1.0, 1.0],
];
const SIXTH: [f64; 5] = [
    -7.502_846_399_306_121,
    2.561_846_144_803_919,
    -11.627_539_656_261_098,
    -0.182_687_676_599_422_56,
    0.030_198_172_008_377_946,
];

const C: [&[f64]; 8] = [
    &[],
    &[-14.155_112_264_123_755],
    &[-17.972_960_358_859_52, -2.859_693_295_451_294],
    &[147.121_502_757_117_16, -1.412_214_027_182_13, 71.689_402_513_023_58],
    &[165.435_170_248_716_76, -0.459_282_345_649_112_6, 42.909_383_369_586_03, -5.961_986_721_573_306],
    &[
        24.854_864_614_690_072,
        -3.000_922_700_283_218_6,
        47.493_111_002_076_8,
        5.581_419_782_155_812_5,
        -0.661_069_182_524_947_1,
    ],
    &[
        30.912_732_140_285_99,
        -3.120_824_334_993_797_4,
        77.799_546_460_708_92,
        34.286_460_282_947_83,
        -19.097_331_116_725_623,
        -28.087_943_162_872_662,
    ],
    &[
        37.802_771_233_905_63,
        -3.257_196_902_907_227_6,
        112.269_188_494_963_27,
        66.934_723_124_404_7,
        -40.066_189_370_910_02,
        -54.667_802_628_779_68,
        -9.488_616_523_096_27,
    ],
];

const TIMES: [f64; 8] = [
    0.0,
    0.635_812_689_582_870_4,
    0.409_579_839_339_753_5,
    0.976_930_672_506_071_6,
    0.428_840_360_955_866_4,
    1.0,
    1.0,
    1.0,
];

const TIME_DERIVATIVE: [f64; 8] = [
    GAMMA,
    -0.423_875_126_388_580_27,
    -0.338_462_712_623_592_4,
    1.804_645_287_288_273_4,
    2.325_825_639_765_069,
    0.0,
    0.0,
    0.0,
];

const DENSE: [&[f64]; 3] = [
    &[
        25.948_786_856_663_858,
        -2.557_972_484_584_623_5,
        10.433_815_404_888_879,
        -2.367_925_102_268_520_4,
        0.524_948_541_321_073,
        1.124_108_831_045_040_4,
        0.427_287_619_443_187_4,
        -0.172_022_210_701_554_93,
    ],
    &[
        -9.915_688_506_951_71,
        -0.968_994_459_411_515_4,
        3.043_803_724_297_845_3,
        -24.495_224_566_215_796,
        20.176_138_334_709_044,
        15.980_663_614_246_51,
        -6.789_040_303_419_874,
        -6.710_236_069_923_372,
    ],
    &[
        11.419_903_575_922_262,
        2.887_964_514_613_699_4,
        72.921_379_959_960_29,
        80.125_118_346_226_43,
        -52.072_871_366_152_654,
        -59.789_936_252_667_29,
        -0.155_826_842_827_519_13,
        4.883_087_185_713_722,
    ],
];
