//! What a fit estimates: the list of its unknowns, and how each is scaled.

/// An unknown of the flexible joint model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unknown {
    /// k of a joint, N m/rad.
    Stiffness(usize),
    /// d of a joint, N m s/rad.
    Damping(usize),
    /// Viscous friction of a motor, N m s/rad.
    Viscous(usize),
    /// Inertia of a motor, kg m².
    Armature(usize),
    /// Viscous friction of a link against the ground, N m s/rad: of a bench alone.
    LinkViscous(usize),
    /// Inertia of the only link, kg m²: where no model says it.
    LinkInertia,
    /// k_e of a bend, N m/rad.
    BendStiffness(usize),
    /// d_e of a bend, N m s/rad.
    BendDamping(usize),
    /// A direction of the rigid bodies' parameters, in its prior's standard deviations.
    Rigid(usize),
    /// Delay of the measurement against the torque, s.
    Delay,
}

/// The delay's unit in a fit, s.
const DELAY_UNIT: f64 = 1e-3;

/// The unknowns in their order, and what is fixed.
#[derive(Debug, Clone, Default)]
pub(super) struct Layout {
    /// In the order of a fit's vector.
    pub(super) unknowns: Vec<Unknown>,
    /// Prior mean and standard deviation of each, in the fit's scale, where it has one.
    pub(super) priors: Vec<Option<(f64, f64)>>,
    /// By how many of those standard deviations each prior's mean may be off: 1, or more where the deviation is known to be too small. Enters the
    /// errors, not the fit.
    pub(super) doubts: Vec<f64>,
    /// What is not estimated and not nothing, in SI units.
    pub(super) fixed: Vec<(Unknown, f64)>,
}

impl Unknown {
    /// Whether its logarithm is estimated: what is positive.
    pub(super) fn is_log(self) -> bool {
        !matches!(self, Self::Rigid(_) | Self::Delay)
    }

    /// Whether it is of the links' bodies.
    pub(super) fn is_body(self) -> bool {
        matches!(self, Self::Rigid(_))
    }
}

impl Layout {
    /// Its place.
    pub(super) fn index(&self, of: Unknown) -> Option<usize> {
        self.unknowns.iter().position(|u| *u == of)
    }

    /// Whether it is estimated or fixed.
    pub(super) fn has(&self, of: Unknown) -> bool {
        self.index(of).is_some() || self.fixed.iter().any(|(unknown, _)| *unknown == of)
    }

    /// Adds an unknown.
    pub(super) fn push(&mut self, of: Unknown, prior: Option<(f64, f64)>) {
        self.push_doubted(of, prior, 1.0);
    }

    /// Adds an unknown whose prior is too sure.
    pub(super) fn push_doubted(&mut self, of: Unknown, prior: Option<(f64, f64)>, doubt: f64) {
        self.unknowns.push(of);
        self.priors.push(prior);
        self.doubts.push(doubt);
    }

    /// The same with some unknowns held at their entries; and the entries that stay.
    pub(super) fn holding(&self, x: &[f64], held: impl Fn(Unknown) -> bool) -> (Self, Vec<f64>) {
        let mut own = Self {
            fixed: self.fixed.clone(),
            ..Self::default()
        };
        let mut kept = Vec::new();
        for (n, &unknown) in self.unknowns.iter().enumerate() {
            if held(unknown) {
                own.fixed.push((unknown, self.value(x, unknown)));
            } else {
                own.push_doubted(unknown, self.priors[n], self.doubts[n]);
                kept.push(x[n]);
            }
        }
        (own, kept)
    }

    /// The entries of all unknowns: what was held at its own of `x`, and the others in the order of `kept`.
    pub(super) fn released(
        &self,
        x: &[f64],
        kept: &[f64],
        held: impl Fn(Unknown) -> bool,
    ) -> Vec<f64> {
        let mut kept = kept.iter();
        let own = self.unknowns.iter().zip(x);
        own.map(|(&unknown, x)| match held(unknown) {
            true => *x,
            false => *kept.next().unwrap_or(x),
        })
        .collect()
    }

    /// Its value in SI units: estimated, fixed or 0.
    pub(super) fn value(&self, x: &[f64], of: Unknown) -> f64 {
        let Some(index) = self.index(of) else {
            let fixed = self.fixed.iter().find(|(unknown, _)| *unknown == of);
            return fixed.map_or(0.0, |(_, value)| *value);
        };
        match of {
            Unknown::Delay => DELAY_UNIT * x[index],
            _ if of.is_log() => x[index].exp(),
            _ => x[index],
        }
    }

    /// The derivative of an unknown's SI value to its entry of the fit's vector.
    pub(super) fn scale(&self, x: &[f64], index: usize) -> f64 {
        match self.unknowns[index] {
            Unknown::Delay => DELAY_UNIT,
            Unknown::Rigid(_) => 1.0,
            _ => x[index].exp(),
        }
    }

    /// The entry of a fit's vector for an SI value.
    pub(super) fn entry(of: Unknown, value: f64) -> f64 {
        match of {
            Unknown::Delay => value / DELAY_UNIT,
            Unknown::Rigid(_) => value,
            _ => value.max(1e-300).ln(),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// All kinds of unknowns of two joints and a bend, with values.
    pub(in super::super) fn two_joints() -> (Layout, Vec<f64>) {
        let values = [
            (Unknown::Stiffness(0), 4e3),
            (Unknown::Stiffness(1), 1e3),
            (Unknown::Damping(0), 3.0),
            (Unknown::Damping(1), 1.0),
            (Unknown::Viscous(0), 2.0),
            (Unknown::Viscous(1), 0.5),
            (Unknown::Armature(0), 0.8),
            (Unknown::Armature(1), 0.3),
            (Unknown::LinkViscous(0), 0.4),
            (Unknown::LinkViscous(1), 0.2),
            (Unknown::BendStiffness(0), 3e3),
            (Unknown::BendDamping(0), 2.0),
            (Unknown::Rigid(0), 0.5),
            (Unknown::Delay, 0.7e-3),
        ];
        let unknowns: Vec<Unknown> = values.iter().map(|(u, _)| *u).collect();
        let x = values.iter().map(|(u, v)| Layout::entry(*u, *v)).collect();
        let priors = vec![None; unknowns.len()];
        let doubts = vec![1.0; unknowns.len()];
        let fixed = Vec::new();
        (
            Layout {
                unknowns,
                priors,
                doubts,
                fixed,
            },
            x,
        )
    }
}
