//! Claims in figures: a sentence that a figure can meet or miss.

/// What a figure must be for a claim to hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// No more than this.
    AtMost(f64),
    /// No less than this.
    AtLeast(f64),
    /// Just this: for counts.
    Exactly(f64),
}

/// A claim, our figure and what it must be.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// Where the claim comes from, such as a figure of the paper.
    pub source: &'static str,
    /// What is claimed.
    pub text: String,
    /// Our figure; NaN where there is none.
    pub ours: f64,
    /// Its unit.
    pub unit: &'static str,
    /// What it must be.
    pub bound: Bound,
}

impl Claim {
    /// A claim on a figure.
    pub fn new(
        source: &'static str,
        text: impl Into<String>,
        ours: f64,
        unit: &'static str,
        bound: Bound,
    ) -> Self {
        Self { source, text: text.into(), ours, unit, bound }
    }

    /// Whether it holds. A figure that is not there holds nothing.
    #[must_use]
    pub fn holds(&self) -> bool {
        match self.bound {
            Bound::AtMost(most) => self.ours <= most,
            Bound::AtLeast(least) => self.ours >= least,
            Bound::Exactly(value) => self.ours == value,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_figure_holds_no_claim() {
        let claim = |ours, bound| Claim::new("", "", ours, "", bound);
        for bound in [Bound::AtMost(1.0), Bound::AtLeast(1.0), Bound::Exactly(1.0)] {
            assert!(claim(1.0, bound).holds());
            assert!(!claim(f64::NAN, bound).holds());
        }
        assert!(claim(0.5, Bound::AtMost(1.0)).holds() && !claim(2.0, Bound::AtMost(1.0)).holds());
        assert!(claim(2.0, Bound::AtLeast(1.0)).holds());
        assert!(!claim(0.5, Bound::AtLeast(1.0)).holds());
        assert!(!claim(2.0, Bound::Exactly(1.0)).holds());
    }
}
