/// Mapping of values to positions.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scale {
    Linear,
    /// Logarithmic scale for values above zero; others are drawn at the lower end.
    Log,
}

/// Range of values and the positions of its ends.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
    scale: Scale,
}

impl Axis {
    /// Creates an axis from `low` at the position `from` to `high` at `to`. A range that is empty
    /// or not finite is widened to one that can be drawn.
    pub fn new(scale: Scale, [low, high]: [f64; 2], [from, to]: [f64; 2]) -> Self {
        let [low, high] = match scale {
            Scale::Linear => drawable([low, high]),
            Scale::Log => drawable_log([low, high]),
        };
        Self { low, high, from, to, scale }
    }

    /// Creates an axis that contains the finite values, from zero (linear) or from the round value
    /// below them (log), to a round value above.
    pub fn around(scale: Scale, values: impl IntoIterator<Item = f64>, places: [f64; 2]) -> Self {
        let finite = values.into_iter().filter(|v| v.is_finite());
        match scale {
            Scale::Linear => {
                let [low, high] = finite.fold([0.0_f64, 0.0], |[l, h], v| [l.min(v), h.max(v)]);
                let step = step_of(high - low, 5.0);
                Self::new(scale, [(low / step).floor() * step, (high / step).ceil() * step], places)
            }
            Scale::Log => {
                // A value without a logarithm has no influence on the range.
                let positive: Vec<f64> = finite.filter(|v| *v > 0.0).collect();
                let low = positive.iter().copied().fold(f64::INFINITY, f64::min);
                let high = positive.iter().copied().fold(0.0, f64::max);
                Self::new(scale, [round_below(low), round_above(high)], places)
            }
        }
    }

    /// Returns the position of a value, within the ends of the axis; `None` if it is NaN.
    pub fn at(&self, value: f64) -> Option<f64> {
        if value.is_nan() {
            return None;
        }
        let value = value.clamp(self.low, self.high);
        let part = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log => (value / self.low).log10() / (self.high / self.low).log10(),
        };
        Some(self.from + part.clamp(0.0, 1.0) * (self.to - self.from))
    }

    /// Returns round values within the axis, as text, and their positions.
    pub fn ticks(&self) -> Vec<(String, f64)> {
        let values = match self.scale {
            Scale::Linear => self.linear_ticks(),
            Scale::Log => self.log_ticks(),
        };
        values.into_iter().filter_map(|(text, v)| Some((text, self.at(v)?))).collect()
    }

    fn linear_ticks(&self) -> Vec<(String, f64)> {
        let step = step_of(self.high - self.low, 5.0);
        let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
        let first = (self.low / step).ceil();
        // The addend keeps a tick at the upper end in spite of rounding.
        let last = (self.high / step + 1e-9).floor();
        // The bound keeps a step that is lost to rounding from filling the chart with ticks.
        let count = (last - first).clamp(0.0, 20.0) as u32;
        let values = (0..=count).map(|i| (first + f64::from(i)) * step);
        values.map(|value| (minus(&format!("{value:.decimals$}")), value)).collect()
    }

    /// Returns the powers of ten; within less than two decades also 2 and 5 times those.
    fn log_ticks(&self) -> Vec<(String, f64)> {
        let first = self.low.log10().floor() as i32;
        let last = (self.high.log10() + 1e-9).floor() as i32;
        let times: &[f64] = if self.high / self.low <= 100.0 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let all = (first..=last.min(first + 20))
            .flat_map(|exponent| times.iter().map(move |t| (exponent, t * 10_f64.powi(exponent))));
        // The margin keeps ticks at the ends from being lost to rounding.
        let inside = self.low * 0.999..=self.high * 1.001;
        all.filter(|(_, v)| inside.contains(v)).map(|(e, v)| (rounded(e, v), v)).collect()
    }
}

/// Returns a round step that divides a range into about `parts` parts: 1, 2 or 5 times a power of
/// ten.
fn step_of(range: f64, parts: f64) -> f64 {
    if !(range.is_finite() && range > 0.0) {
        return 1.0;
    }
    let rough = range / parts;
    let unit = 10_f64.powf(rough.log10().floor());
    let times = [1.0, 2.0, 5.0].into_iter().find(|t| t * unit >= rough * 0.999).unwrap_or(10.0);
    times * unit
}

/// Largest value that is drawn, so that differences stay finite.
const FARTHEST: f64 = 1e12;

fn drawable([low, high]: [f64; 2]) -> [f64; 2] {
    let low = if low.is_nan() { 0.0 } else { low.clamp(-FARTHEST, FARTHEST) };
    let high = if high.is_nan() { low } else { high.clamp(-FARTHEST, FARTHEST) };
    // Ends closer than this are equal within the precision of the positions.
    let least = (low.abs() * 1e-6).max(1e-9);
    if high - low >= least { [low, high] } else { [low, low + least.max(1.0)] }
}

fn drawable_log([low, high]: [f64; 2]) -> [f64; 2] {
    let low = if low.is_finite() && low > 0.0 { low.clamp(1e-9, FARTHEST) } else { 0.1 };
    let high = if high.is_finite() { high.min(FARTHEST) } else { low };
    if high >= low * 1.1 { [low, high] } else { [low, low * 10.0] }
}

/// Returns the greatest of 1, 2 and 5 times a power of ten that is not above the value.
fn round_below(value: f64) -> f64 {
    let unit = 10_f64.powf(value.log10().floor());
    [5.0, 2.0].into_iter().map(|t| t * unit).find(|v| *v <= value).unwrap_or(unit)
}

/// Returns the least of 1, 2 and 5 times a power of ten that is not below the value.
fn round_above(value: f64) -> f64 {
    let unit = 10_f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0].into_iter().map(|t| t * unit).find(|v| *v >= value).unwrap_or(10.0 * unit)
}

fn rounded(exponent: i32, value: f64) -> String {
    if (-4..=5).contains(&exponent) {
        let decimals = usize::try_from(-exponent).unwrap_or(0);
        format!("{value:.decimals$}")
    } else {
        format!("{value:e}")
    }
}

/// Replaces hyphens by true minus signs, which screen readers read and which are as wide as a plus.
pub fn minus(text: &str) -> String {
    // A negative number that rounds to zero loses its sign.
    let zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    text.replace('-', if zero { "" } else { "\u{2212}" })
}
