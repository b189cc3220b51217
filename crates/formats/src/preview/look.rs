//! Look of a picture: its size, colours, title and kind of file.

use super::ink::Ink;
use std::ops::RangeInclusive;

/// Allowed picture sizes, in pixels along a side.
pub const SIZES: RangeInclusive<usize> = 64..=2048;
/// Default picture size, in pixels along a side.
pub const DEFAULT_SIZE: usize = 256;

/// Style of a picture: the colours of paper, lines and text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Style {
    /// Light lines on dark ground, for screens.
    #[default]
    Dark,
    /// Dark lines on white, for data sheets and print.
    Light,
}

impl Style {
    /// All styles.
    pub const ALL: [Self; 2] = [Self::Dark, Self::Light];

    /// Returns the name of the style.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dark => "dark",
            Self::Light => "light",
        }
    }
}

/// Look of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Look<'a> {
    /// Width and height of the picture in pixels.
    pub size: usize,
    /// Style of a diagram; a ball is always on dark ground.
    pub style: Style,
    /// Title above a diagram.
    pub title: Option<&'a str>,
    /// True for SVG, false for PNG. A ball, which is made of pixels, has no SVG.
    pub is_svg: bool,
}

impl Default for Look<'_> {
    fn default() -> Self {
        Self { size: DEFAULT_SIZE, style: Style::Dark, title: None, is_svg: false }
    }
}

/// Colours of a picture, gamma-encoded sRGB from 0 to 1.
#[derive(Debug)]
pub(super) struct Palette {
    /// Colour of the background.
    pub(super) paper: Ink,
    /// Colour of grid lines.
    pub(super) grid: Ink,
    /// Colour of axes.
    pub(super) axis: Ink,
    /// Colour of labels.
    pub(super) text: Ink,
    /// Colour of the only curve in a plot.
    pub(super) curve: Ink,
    /// Colour of curves if the light that they show is black or of unknown colour.
    pub(super) neutral: Ink,
}

const DARK: Palette = Palette {
    paper: [0.085, 0.09, 0.10],
    grid: [0.22, 0.23, 0.25],
    axis: [0.40, 0.42, 0.45],
    text: [0.72, 0.74, 0.77],
    curve: [0.92, 0.93, 0.95],
    neutral: [0.66, 0.72, 0.82],
};

const LIGHT: Palette = Palette {
    paper: [1.0, 1.0, 1.0],
    grid: [0.86, 0.87, 0.88],
    axis: [0.45, 0.46, 0.48],
    text: [0.15, 0.16, 0.18],
    curve: [0.12, 0.13, 0.15],
    neutral: [0.16, 0.34, 0.60],
};

impl Look<'_> {
    pub(super) fn palette(&self) -> &'static Palette {
        match self.style {
            Style::Dark => &DARK,
            Style::Light => &LIGHT,
        }
    }
}

impl Palette {
    /// Returns a colour that can be told from the paper: lightened on dark paper, darkened on white.
    pub(super) fn visible(&self, ink: Ink, least: f32) -> Ink {
        let light = ink.iter().copied().fold(0.0, f32::max);
        if self.paper[0] < 0.5 {
            return ink.map(|c| c + (least - light).max(0.0));
        }
        // Luma above which a line vanishes on white.
        let luma = 0.3 * ink[0] + 0.59 * ink[1] + 0.11 * ink[2];
        let most = 0.55_f32;
        if luma > most { ink.map(|c| c * most / luma) } else { ink }
    }
}
