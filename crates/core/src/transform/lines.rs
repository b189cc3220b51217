//! Registry of all bases on a line: one table row per basis, with its number in files.
//!
//! To add a basis, add a table in `tables/` and one row at the end of [`LINES`] with the next number. Never change a
//! number or remove a row: files refer to bases by number.
#![allow(clippy::wildcard_imports, reason = "the registry names every table there is")]

use super::basis_info::{BasisInfo, Space};
use super::boundary::Boundary;
use super::filters::Filters::{self, Biorthogonal, Orthogonal};
use super::filters::{Bank, PERFECT};
use super::tables::adelson::QMF9;
use super::tables::battle_lemarie::{SPLINE1, SPLINE3, SPLINE5};
use super::tables::beylkin::BEYLKIN;
use super::tables::biorthogonal::*;
use super::tables::brislawn::{B10_10_ANALYSIS, B10_10_SYNTHESIS};
use super::tables::coiflets::*;
use super::tables::daubechies::*;
use super::tables::meyer::DMEY;
use super::tables::odegard::{O9_7_ANALYSIS, O9_7_SYNTHESIS};
use super::tables::symlets::*;
use super::tables::vaidyanathan::VAIDYANATHAN;
use super::tables::villasenor::*;
use crate::domain::UnknownName;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

/// Wavelet basis on an ordered axis (wavelengths, elevations, or any ordered entries), identified by its number in a
/// table. All bases give as many coefficients as samples at every length. Sign, scale (low-pass gain √2 at zero
/// frequency) and position agree with PyWavelets.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LineBasis(u16);

/// Entry of the table of wavelet bases: name, family, filters and properties of one basis.
pub(super) struct Line {
    code: u16,
    name: &'static str,
    family: &'static Family,
    filters: Filters,
    /// Number of vanishing moments of the analysis wavelet.
    moments: usize,
    /// Fastest method to compute one level of the wavelet transform under the default boundary rule.
    pub(super) scheme: Scheme,
}

/// Family of wavelet bases of common origin.
struct Family {
    name: &'static str,
    source: &'static str,
}

/// Method that turns the samples of one wavelet level into smooth coefficients (at even positions) and details (at odd
/// positions).
#[derive(Clone, Copy, Debug)]
pub(super) enum Scheme {
    /// Filter bank: each coefficient is a sum of samples weighted by the taps of a filter.
    Filters,
    /// Reflection of each pair of samples (a, b): `(α·a + β·b, β·a − α·b)` with α² + β² = 1. The ratio α/β follows from
    /// the number of original samples that each value represents.
    Pairs,
    /// Lifting scheme: each step adds to every other sample a multiple of the sum of its two neighbours.
    Lifting(&'static Lifting),
}

/// Factorisation of a wavelet into lifting steps. After the steps, even samples are multiplied by `low` and odd ones by
/// −1/`low` (Daubechies & Sweldens 1998).
#[derive(Debug)]
pub(super) struct Lifting {
    /// Lifting steps in order: the parity of the samples that change, and the factor of the sum of their two neighbours
    /// that is added to them.
    pub(super) steps: &'static [(Parity, f32)],
    /// Scale factor of the smooth (even) samples after the lifting steps.
    pub(super) low: f32,
}

/// Choice between the even and the odd samples of a wavelet level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parity {
    Even,
    Odd,
}

static LIFTING_5_3: Lifting =
    Lifting { steps: &[(Parity::Odd, -0.5), (Parity::Even, 0.25)], low: std::f32::consts::SQRT_2 };

static LIFTING_9_7: Lifting = Lifting {
    steps: &[
        (Parity::Odd, -1.586_134_3),
        (Parity::Even, -0.052_980_12),
        (Parity::Odd, 0.882_911_1),
        (Parity::Even, 0.443_506_85),
    ],
    // ζ of Daubechies & Sweldens, with which a constant grows by √2 per level.
    low: 1.149_604_4,
};

static DAUBECHIES: Family =
    Family { name: "Daubechies", source: "Daubechies 1992, Ten Lectures on Wavelets, table 6.1; Haar 1910" };
static SYMLETS: Family = Family { name: "symlets", source: "Daubechies 1992, Ten Lectures on Wavelets, table 6.3" };
static COIFLETS: Family =
    Family { name: "coiflets", source: "Daubechies 1993, Orthonormal bases of compactly supported wavelets II" };
static SPLINES: Family = Family {
    name: "biorthogonal splines",
    source: "Cohen, Daubechies & Feauveau 1992, Biorthogonal bases of compactly supported wavelets; lifting of 2.2 and 4.4: Daubechies & Sweldens 1998, sections 7.5 and 7.7",
};
static MEYER: Family =
    Family { name: "Meyer", source: "Meyer 1992, Wavelets and Operators; cut to 61 taps as in Matlab and PyWavelets" };
static VILLASENOR: Family = Family {
    name: "Villasenor",
    source: "Villasenor, Belzer & Liao 1995, Wavelet filter evaluation for image compression; 18/10 unpublished, digits of Davis 1996, Baseline wavelet transform coder construction kit",
};
static ANTONINI: Family = Family {
    name: "Antonini",
    source: "Antonini, Barlaud, Mathieu & Daubechies 1992, Image coding using wavelet transform; equal to bior4.4",
};
static BRISLAWN: Family = Family {
    name: "Brislawn",
    source: "Brislawn 1995, Fingerprints go digital, and its author's tutorial code; 9/7 is equal to bior4.4",
};
static ODEGARD: Family = Family {
    name: "Odegard",
    source: "Odegard & Burrus 1996, Smooth biorthogonal wavelets for applications in image compression",
};
static ADELSON: Family = Family {
    name: "quadrature mirror",
    source: "Adelson, Simoncelli & Hingorani 1987, Orthogonal pyramid transforms for image coding",
};
static BEYLKIN_FAMILY: Family = Family {
    name: "Beylkin",
    source: "Beylkin, Coifman & Rokhlin 1991, Fast wavelet transforms and numerical algorithms I",
};
static VAIDYANATHAN_FAMILY: Family = Family {
    name: "Vaidyanathan",
    source: "Vaidyanathan & Hoang 1988, Lattice structures for optimal design and robust implementation of two-channel perfect-reconstruction QMF banks",
};
static BATTLE_LEMARIE: Family = Family {
    name: "Battle–Lemarié",
    source: "Battle 1987, A block spin construction of ondelettes I; Lemarié 1988, Ondelettes à localisation exponentielle; cut to 23, 41, 59 taps",
};

const fn line(code: u16, name: &'static str, family: &'static Family, filters: Filters, moments: usize) -> Line {
    Line { code, name, family, filters, moments, scheme: Scheme::Filters }
}

impl Line {
    const fn pairs(self) -> Self {
        Self { scheme: Scheme::Pairs, ..self }
    }

    const fn lifted(self, lifting: &'static Lifting) -> Self {
        Self { scheme: Scheme::Lifting(lifting), ..self }
    }
}

#[rustfmt::skip]
static LINES: &[Line] = &[
    line(0, "haar", &DAUBECHIES, Orthogonal(&DB1), 1).pairs(),
    line(1, "db1", &DAUBECHIES, Orthogonal(&DB1), 1).pairs(),
    line(2, "db2", &DAUBECHIES, Orthogonal(&DB2), 2),
    line(3, "db3", &DAUBECHIES, Orthogonal(&DB3), 3),
    line(4, "db4", &DAUBECHIES, Orthogonal(&DB4), 4),
    line(5, "db5", &DAUBECHIES, Orthogonal(&DB5), 5),
    line(6, "db6", &DAUBECHIES, Orthogonal(&DB6), 6),
    line(7, "db7", &DAUBECHIES, Orthogonal(&DB7), 7),
    line(8, "db8", &DAUBECHIES, Orthogonal(&DB8), 8),
    line(9, "db9", &DAUBECHIES, Orthogonal(&DB9), 9),
    line(10, "db10", &DAUBECHIES, Orthogonal(&DB10), 10),
    line(11, "db11", &DAUBECHIES, Orthogonal(&DB11), 11),
    line(12, "db12", &DAUBECHIES, Orthogonal(&DB12), 12),
    line(13, "db13", &DAUBECHIES, Orthogonal(&DB13), 13),
    line(14, "db14", &DAUBECHIES, Orthogonal(&DB14), 14),
    line(15, "db15", &DAUBECHIES, Orthogonal(&DB15), 15),
    line(16, "db16", &DAUBECHIES, Orthogonal(&DB16), 16),
    line(17, "db17", &DAUBECHIES, Orthogonal(&DB17), 17),
    line(18, "db18", &DAUBECHIES, Orthogonal(&DB18), 18),
    line(19, "db19", &DAUBECHIES, Orthogonal(&DB19), 19),
    line(20, "db20", &DAUBECHIES, Orthogonal(&DB20), 20),
    line(21, "db21", &DAUBECHIES, Orthogonal(&DB21), 21),
    line(22, "db22", &DAUBECHIES, Orthogonal(&DB22), 22),
    line(23, "db23", &DAUBECHIES, Orthogonal(&DB23), 23),
    line(24, "db24", &DAUBECHIES, Orthogonal(&DB24), 24),
    line(25, "db25", &DAUBECHIES, Orthogonal(&DB25), 25),
    line(26, "db26", &DAUBECHIES, Orthogonal(&DB26), 26),
    line(27, "db27", &DAUBECHIES, Orthogonal(&DB27), 27),
    line(28, "db28", &DAUBECHIES, Orthogonal(&DB28), 28),
    line(29, "db29", &DAUBECHIES, Orthogonal(&DB29), 29),
    line(30, "db30", &DAUBECHIES, Orthogonal(&DB30), 30),
    line(31, "db31", &DAUBECHIES, Orthogonal(&DB31), 31),
    line(32, "db32", &DAUBECHIES, Orthogonal(&DB32), 32),
    line(33, "db33", &DAUBECHIES, Orthogonal(&DB33), 33),
    line(34, "db34", &DAUBECHIES, Orthogonal(&DB34), 34),
    line(35, "db35", &DAUBECHIES, Orthogonal(&DB35), 35),
    line(36, "db36", &DAUBECHIES, Orthogonal(&DB36), 36),
    line(37, "db37", &DAUBECHIES, Orthogonal(&DB37), 37),
    line(38, "db38", &DAUBECHIES, Orthogonal(&DB38), 38),
    line(39, "sym2", &SYMLETS, Orthogonal(&SYM2), 2),
    line(40, "sym3", &SYMLETS, Orthogonal(&SYM3), 3),
    line(41, "sym4", &SYMLETS, Orthogonal(&SYM4), 4),
    line(42, "sym5", &SYMLETS, Orthogonal(&SYM5), 5),
    line(43, "sym6", &SYMLETS, Orthogonal(&SYM6), 6),
    line(44, "sym7", &SYMLETS, Orthogonal(&SYM7), 7),
    line(45, "sym8", &SYMLETS, Orthogonal(&SYM8), 8),
    line(46, "sym9", &SYMLETS, Orthogonal(&SYM9), 9),
    line(47, "sym10", &SYMLETS, Orthogonal(&SYM10), 10),
    line(48, "sym11", &SYMLETS, Orthogonal(&SYM11), 11),
    line(49, "sym12", &SYMLETS, Orthogonal(&SYM12), 12),
    line(50, "sym13", &SYMLETS, Orthogonal(&SYM13), 13),
    line(51, "sym14", &SYMLETS, Orthogonal(&SYM14), 14),
    line(52, "sym15", &SYMLETS, Orthogonal(&SYM15), 15),
    line(53, "sym16", &SYMLETS, Orthogonal(&SYM16), 16),
    line(54, "sym17", &SYMLETS, Orthogonal(&SYM17), 17),
    line(55, "sym18", &SYMLETS, Orthogonal(&SYM18), 18),
    line(56, "sym19", &SYMLETS, Orthogonal(&SYM19), 19),
    line(57, "sym20", &SYMLETS, Orthogonal(&SYM20), 20),
    line(58, "coif1", &COIFLETS, Orthogonal(&COIF1), 2),
    line(59, "coif2", &COIFLETS, Orthogonal(&COIF2), 4),
    line(60, "coif3", &COIFLETS, Orthogonal(&COIF3), 6),
    line(61, "coif4", &COIFLETS, Orthogonal(&COIF4), 8),
    line(62, "coif5", &COIFLETS, Orthogonal(&COIF5), 10),
    line(63, "coif6", &COIFLETS, Orthogonal(&COIF6), 12),
    line(64, "coif7", &COIFLETS, Orthogonal(&COIF7), 14),
    line(65, "coif8", &COIFLETS, Orthogonal(&COIF8), 16),
    line(66, "coif9", &COIFLETS, Orthogonal(&COIF9), 18),
    line(67, "coif10", &COIFLETS, Orthogonal(&COIF10), 20),
    line(68, "coif11", &COIFLETS, Orthogonal(&COIF11), 22),
    line(69, "coif12", &COIFLETS, Orthogonal(&COIF12), 24),
    line(70, "coif13", &COIFLETS, Orthogonal(&COIF13), 26),
    line(71, "coif14", &COIFLETS, Orthogonal(&COIF14), 28),
    line(72, "coif15", &COIFLETS, Orthogonal(&COIF15), 30),
    line(73, "coif16", &COIFLETS, Orthogonal(&COIF16), 32),
    line(74, "coif17", &COIFLETS, Orthogonal(&COIF17), 34),
    line(75, "bior1.1", &SPLINES, Orthogonal(&DB1), 1).pairs(),
    line(76, "bior1.3", &SPLINES, Biorthogonal { analysis: &BIOR1_3_ANALYSIS, synthesis: &BIOR1_3_SYNTHESIS }, 1),
    line(77, "bior1.5", &SPLINES, Biorthogonal { analysis: &BIOR1_5_ANALYSIS, synthesis: &BIOR1_5_SYNTHESIS }, 1),
    line(78, "bior2.2", &SPLINES, Biorthogonal { analysis: &BIOR2_2_ANALYSIS, synthesis: &BIOR2_2_SYNTHESIS }, 2).lifted(&LIFTING_5_3),
    line(79, "bior2.4", &SPLINES, Biorthogonal { analysis: &BIOR2_4_ANALYSIS, synthesis: &BIOR2_4_SYNTHESIS }, 2),
    line(80, "bior2.6", &SPLINES, Biorthogonal { analysis: &BIOR2_6_ANALYSIS, synthesis: &BIOR2_6_SYNTHESIS }, 2),
    line(81, "bior2.8", &SPLINES, Biorthogonal { analysis: &BIOR2_8_ANALYSIS, synthesis: &BIOR2_8_SYNTHESIS }, 2),
    line(82, "bior3.1", &SPLINES, Biorthogonal { analysis: &BIOR3_1_ANALYSIS, synthesis: &BIOR3_1_SYNTHESIS }, 3),
    line(83, "bior3.3", &SPLINES, Biorthogonal { analysis: &BIOR3_3_ANALYSIS, synthesis: &BIOR3_3_SYNTHESIS }, 3),
    line(84, "bior3.5", &SPLINES, Biorthogonal { analysis: &BIOR3_5_ANALYSIS, synthesis: &BIOR3_5_SYNTHESIS }, 3),
    line(85, "bior3.7", &SPLINES, Biorthogonal { analysis: &BIOR3_7_ANALYSIS, synthesis: &BIOR3_7_SYNTHESIS }, 3),
    line(86, "bior3.9", &SPLINES, Biorthogonal { analysis: &BIOR3_9_ANALYSIS, synthesis: &BIOR3_9_SYNTHESIS }, 3),
    line(87, "bior4.4", &SPLINES, Biorthogonal { analysis: &BIOR4_4_ANALYSIS, synthesis: &BIOR4_4_SYNTHESIS }, 4).lifted(&LIFTING_9_7),
    line(88, "bior5.5", &SPLINES, Biorthogonal { analysis: &BIOR5_5_ANALYSIS, synthesis: &BIOR5_5_SYNTHESIS }, 6),
    line(89, "bior6.8", &SPLINES, Biorthogonal { analysis: &BIOR6_8_ANALYSIS, synthesis: &BIOR6_8_SYNTHESIS }, 6),
    line(90, "rbio1.1", &SPLINES, Orthogonal(&DB1), 1).pairs(),
    line(91, "rbio1.3", &SPLINES, Biorthogonal { analysis: &BIOR1_3_SYNTHESIS, synthesis: &BIOR1_3_ANALYSIS }, 3),
    line(92, "rbio1.5", &SPLINES, Biorthogonal { analysis: &BIOR1_5_SYNTHESIS, synthesis: &BIOR1_5_ANALYSIS }, 5),
    line(93, "rbio2.2", &SPLINES, Biorthogonal { analysis: &BIOR2_2_SYNTHESIS, synthesis: &BIOR2_2_ANALYSIS }, 2),
    line(94, "rbio2.4", &SPLINES, Biorthogonal { analysis: &BIOR2_4_SYNTHESIS, synthesis: &BIOR2_4_ANALYSIS }, 4),
    line(95, "rbio2.6", &SPLINES, Biorthogonal { analysis: &BIOR2_6_SYNTHESIS, synthesis: &BIOR2_6_ANALYSIS }, 6),
    line(96, "rbio2.8", &SPLINES, Biorthogonal { analysis: &BIOR2_8_SYNTHESIS, synthesis: &BIOR2_8_ANALYSIS }, 8),
    line(97, "rbio3.1", &SPLINES, Biorthogonal { analysis: &BIOR3_1_SYNTHESIS, synthesis: &BIOR3_1_ANALYSIS }, 1),
    line(98, "rbio3.3", &SPLINES, Biorthogonal { analysis: &BIOR3_3_SYNTHESIS, synthesis: &BIOR3_3_ANALYSIS }, 3),
    line(99, "rbio3.5", &SPLINES, Biorthogonal { analysis: &BIOR3_5_SYNTHESIS, synthesis: &BIOR3_5_ANALYSIS }, 5),
    line(100, "rbio3.7", &SPLINES, Biorthogonal { analysis: &BIOR3_7_SYNTHESIS, synthesis: &BIOR3_7_ANALYSIS }, 7),
    line(101, "rbio3.9", &SPLINES, Biorthogonal { analysis: &BIOR3_9_SYNTHESIS, synthesis: &BIOR3_9_ANALYSIS }, 9),
    line(102, "rbio4.4", &SPLINES, Biorthogonal { analysis: &BIOR4_4_SYNTHESIS, synthesis: &BIOR4_4_ANALYSIS }, 4),
    line(103, "rbio5.5", &SPLINES, Biorthogonal { analysis: &BIOR5_5_SYNTHESIS, synthesis: &BIOR5_5_ANALYSIS }, 4),
    line(104, "rbio6.8", &SPLINES, Biorthogonal { analysis: &BIOR6_8_SYNTHESIS, synthesis: &BIOR6_8_ANALYSIS }, 8),
    line(105, "dmey", &MEYER, Orthogonal(&DMEY), 0),
    line(106, "villasenor9.7", &VILLASENOR, Biorthogonal { analysis: &BIOR4_4_ANALYSIS, synthesis: &BIOR4_4_SYNTHESIS }, 4).lifted(&LIFTING_9_7),
    line(107, "villasenor13.11", &VILLASENOR, Biorthogonal { analysis: &V13_11_ANALYSIS, synthesis: &V13_11_SYNTHESIS }, 6),
    line(108, "villasenor6.10", &VILLASENOR, Biorthogonal { analysis: &V6_10_ANALYSIS, synthesis: &V6_10_SYNTHESIS }, 5),
    line(109, "villasenor5.3", &VILLASENOR, Biorthogonal { analysis: &BIOR2_2_ANALYSIS, synthesis: &BIOR2_2_SYNTHESIS }, 2).lifted(&LIFTING_5_3),
    line(110, "villasenor2.6", &VILLASENOR, Biorthogonal { analysis: &BIOR1_3_SYNTHESIS, synthesis: &BIOR1_3_ANALYSIS }, 3),
    line(111, "villasenor9.3", &VILLASENOR, Biorthogonal { analysis: &BIOR2_4_ANALYSIS, synthesis: &BIOR2_4_SYNTHESIS }, 2),
    line(112, "villasenor18.10", &VILLASENOR, Biorthogonal { analysis: &V18_10_ANALYSIS, synthesis: &V18_10_SYNTHESIS }, 9),
    line(113, "antonini9.7", &ANTONINI, Biorthogonal { analysis: &BIOR4_4_ANALYSIS, synthesis: &BIOR4_4_SYNTHESIS }, 4).lifted(&LIFTING_9_7),
    line(114, "brislawn9.7", &BRISLAWN, Biorthogonal { analysis: &BIOR4_4_ANALYSIS, synthesis: &BIOR4_4_SYNTHESIS }, 4).lifted(&LIFTING_9_7),
    line(115, "brislawn10.10", &BRISLAWN, Biorthogonal { analysis: &B10_10_ANALYSIS, synthesis: &B10_10_SYNTHESIS }, 5),
    line(116, "odegard9.7", &ODEGARD, Biorthogonal { analysis: &O9_7_ANALYSIS, synthesis: &O9_7_SYNTHESIS }, 2),
    line(117, "adelson9", &ADELSON, Orthogonal(&QMF9), 2),
    line(118, "beylkin18", &BEYLKIN_FAMILY, Orthogonal(&BEYLKIN), 3),
    line(119, "vaidyanathan24", &VAIDYANATHAN_FAMILY, Orthogonal(&VAIDYANATHAN), 0),
    line(120, "battle-lemarie1", &BATTLE_LEMARIE, Orthogonal(&SPLINE1), 2),
    line(121, "battle-lemarie3", &BATTLE_LEMARIE, Orthogonal(&SPLINE3), 2),
    line(122, "battle-lemarie5", &BATTLE_LEMARIE, Orthogonal(&SPLINE5), 2),
];

/// Filter bank and description of every wavelet basis, derived from its filter table, in the order of [`LINES`].
static KNOWN: LazyLock<Vec<(Bank, BasisInfo)>> = LazyLock::new(|| {
    LINES
        .iter()
        .map(|line| {
            let bank = Bank::new(line.filters);
            let info = BasisInfo {
                name: line.name,
                space: Space::Line,
                family: line.family.name,
                analysis_length: bank.analysis[0].weights.len(),
                synthesis_length: bank.synthesis[0].weights.len(),
                vanishing_moments: line.moments,
                symmetric: bank.symmetry.is_some(),
                orthogonal: bank.orthogonal && bank.error < PERFECT,
                reconstruction_error: bank.error,
                boundary: Some(own_rule(&bank)),
                source: line.family.source,
            };
            (bank, info)
        })
        .collect()
});

/// Returns the default boundary rule of a filter bank: symmetric extension for symmetric filters that are not
/// orthogonal. All others get special filters at the ends, which keep an orthogonal basis orthogonal.
fn own_rule(bank: &Bank) -> Boundary {
    match bank.symmetry {
        Some(symmetry) if !bank.orthogonal || bank.error >= PERFECT => symmetry,
        _ => Boundary::Fitted,
    }
}

impl LineBasis {
    /// Haar basis. With special filters at the ends it is unbalanced at odd lengths (Girardi & Sweldens 1997), and thus
    /// orthonormal.
    pub const HAAR: Self = Self(0);
    /// Cohen–Daubechies–Feauveau 5/3 basis (Le Gall and Tabatabai), computed by lifting under whole-sample extension.
    pub const BIOR22: Self = Self(78);
    /// Cohen–Daubechies–Feauveau 9/7 basis (Antonini, Brislawn), computed by lifting under whole-sample extension.
    pub const BIOR44: Self = Self(87);

    /// Returns all wavelet bases on an ordered axis, by number.
    pub fn all() -> impl ExactSizeIterator<Item = Self> + Clone {
        (0..LINES.len() as u16).map(Self)
    }

    /// Returns all different wavelet bases on an ordered axis. Of bases with several names, only the one with the
    /// lowest number is included.
    pub fn distinct() -> impl Iterator<Item = Self> + Clone {
        Self::all().filter(|basis| {
            let (bank, _) = &KNOWN[basis.index()];
            let same = |(other, _): &(Bank, BasisInfo)| {
                other.analysis[0] == bank.analysis[0] && other.synthesis[0] == bank.synthesis[0]
            };
            !KNOWN[..basis.index()].iter().any(same)
        })
    }

    /// Returns the stable name of the wavelet basis; bases of PyWavelets have the same name there.
    pub fn name(self) -> &'static str {
        self.line().name
    }

    /// Returns the number that identifies the wavelet basis in files and never changes.
    pub fn code(self) -> u16 {
        self.line().code
    }

    /// Returns the wavelet basis with this number.
    pub fn from_code(code: u16) -> Option<Self> {
        LINES.iter().position(|line| line.code == code).map(|i| Self(i as u16))
    }

    /// Returns the description of the wavelet basis.
    pub fn info(self) -> &'static BasisInfo {
        &KNOWN[self.index()].1
    }

    /// Returns the default boundary rule of the basis: special filters at the ends for orthogonal or asymmetric bases,
    /// otherwise the symmetric extension.
    pub fn boundary(self) -> Boundary {
        own_rule(self.bank())
    }

    pub(super) fn bank(self) -> &'static Bank {
        &KNOWN[self.index()].0
    }

    pub(super) fn line(self) -> &'static Line {
        &LINES[self.index()]
    }

    fn index(self) -> usize {
        usize::from(self.0)
    }
}

impl fmt::Display for LineBasis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Debug for LineBasis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for LineBasis {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        Self::all().find(|basis| basis.name() == name).ok_or_else(|| UnknownName {
            what: "basis on a line",
            found: name.to_owned(),
            expected: Self::all().map(Self::name).collect::<Vec<_>>().join(", "),
        })
    }
}

impl Serialize for LineBasis {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for LineBasis {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = <std::borrow::Cow<'de, str>>::deserialize(deserializer)?;
        name.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wavelet bases with their numbers. Entries are only ever appended, because files contain the numbers.
    const NUMBERS: &str = "0=haar 1=db1 2=db2 3=db3 4=db4 5=db5 6=db6 7=db7 8=db8 9=db9 10=db10 11=db11 12=db12 13=db13 14=db14 15=db15 \
        16=db16 17=db17 18=db18 19=db19 20=db20 21=db21 22=db22 23=db23 24=db24 25=db25 26=db26 27=db27 28=db28 \
        29=db29 30=db30 31=db31 32=db32 33=db33 34=db34 35=db35 36=db36 37=db37 38=db38 39=sym2 40=sym3 41=sym4 \
        42=sym5 43=sym6 44=sym7 45=sym8 46=sym9 47=sym10 48=sym11 49=sym12 50=sym13 51=sym14 52=sym15 53=sym16 \
        54=sym17 55=sym18 56=sym19 57=sym20 58=coif1 59=coif2 60=coif3 61=coif4 62=coif5 63=coif6 64=coif7 65=coif8 \
        66=coif9 67=coif10 68=coif11 69=coif12 70=coif13 71=coif14 72=coif15 73=coif16 74=coif17 75=bior1.1 \
        76=bior1.3 77=bior1.5 78=bior2.2 79=bior2.4 80=bior2.6 81=bior2.8 82=bior3.1 83=bior3.3 84=bior3.5 \
        85=bior3.7 86=bior3.9 87=bior4.4 88=bior5.5 89=bior6.8 90=rbio1.1 91=rbio1.3 92=rbio1.5 93=rbio2.2 \
        94=rbio2.4 95=rbio2.6 96=rbio2.8 97=rbio3.1 98=rbio3.3 99=rbio3.5 100=rbio3.7 101=rbio3.9 102=rbio4.4 \
        103=rbio5.5 104=rbio6.8 105=dmey 106=villasenor9.7 107=villasenor13.11 108=villasenor6.10 109=villasenor5.3 \
        110=villasenor2.6 111=villasenor9.3 112=villasenor18.10 113=antonini9.7 114=brislawn9.7 115=brislawn10.10 \
        116=odegard9.7 117=adelson9 118=beylkin18 119=vaidyanathan24 120=battle-lemarie1 121=battle-lemarie3 \
        122=battle-lemarie5";

    #[test]
    fn numbers_never_change() {
        let now: Vec<_> = LineBasis::all().map(|basis| format!("{}={}", basis.code(), basis.name())).collect();
        assert!(now.join(" ").starts_with(NUMBERS), "{}", now.join(" "));
        for basis in LineBasis::all() {
            assert_eq!(LineBasis::from_code(basis.code()), Some(basis));
            assert_eq!(basis.name().parse(), Ok(basis));
        }
        assert_eq!(LineBasis::from_code(u16::MAX), None);
    }

    #[test]
    fn constants_are_the_bases_they_name() {
        let named = [LineBasis::HAAR, LineBasis::BIOR22, LineBasis::BIOR44].map(LineBasis::name);
        assert_eq!(named, ["haar", "bior2.2", "bior4.4"]);
        assert_eq!(LineBasis::BIOR44.boundary(), Boundary::WholeSample);
        assert_eq!(LineBasis::HAAR.boundary(), Boundary::Fitted);
    }

    #[test]
    fn names_are_unique_and_the_distinct_are_fewer() {
        let mut names: Vec<_> = LineBasis::all().map(LineBasis::name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), LINES.len());
        let distinct: Vec<_> = LineBasis::distinct().collect();
        assert!(distinct.contains(&LineBasis::BIOR44) && !distinct.iter().any(|b| b.name() == "antonini9.7"));
        assert!(distinct.len() > 100);
    }

    #[test]
    fn an_unknown_name_is_refused() {
        let error = "db39".parse::<LineBasis>().unwrap_err();
        assert_eq!((error.what, error.found.as_str()), ("basis on a line", "db39"));
    }
}
