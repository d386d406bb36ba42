//! The physical terms that a search for an unknown torque goes through: what multiplies (a direction, a speed, a load) times how that
//! depends on position, speed, load, time and the other joints.
//!
//! The forms are those of known mechanisms: friction that depends on where the joint is, end stops, cables, ripple in proportion to a torque
//! or to friction, warming, and what changes at a moment. Each is a text that [`define`](super::define) takes, so that what is
//! found is an effect as any other.

use proprio_core::effect::{Grid, JointState};

use super::columns::{value, values};
use super::expression::Expression;
use super::parse::{Names, parse};
use super::{FormulaError, NUMBERED_TIMES};

/// What is multiplied beside nothing: friction, viscous friction, friction by load, the load.
pub(crate) const CARRIERS: [&str; 4] = ["sign(dq)", "dq", "abs(tau_rigid)*sign(dq)", "tau_rigid"];

/// Where a term begins or ends that does nothing elsewhere: at its parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Border {
    /// It acts at larger positions.
    Beyond,
    /// It acts at smaller positions.
    Below,
    /// It acts from a moment on.
    After,
}

/// How it depends on the joint's own position, and on time, and where that begins or ends. With any carrier.
const ANYWHERE: [(&str, Option<Grid>, Option<Border>); 10] = [
    ("q", None, None),
    ("q^2", None, None),
    ("abs(q - p)", Some(Grid::Positions), None),
    ("(q - p)*abs(q - p)", Some(Grid::Positions), None),
    ("step(q - p)", Some(Grid::Positions), Some(Border::Beyond)),
    ("max(q - p, 0)", Some(Grid::Positions), Some(Border::Beyond)),
    ("max(p - q, 0)", Some(Grid::Positions), Some(Border::Below)),
    ("t", None, None),
    ("step(t - p)", Some(Grid::Times), Some(Border::After)),
    ("exp(-t/p)", Some(NUMBERED_TIMES), None),
];

/// Places of this share of the joint's travel, to which a magnet pulls or at which friction is larger: of its own, and with friction.
const WIDTHS: [f64; 6] = [0.3, 0.21, 0.15, 0.11, 0.08, 0.055];
const AT_PLACES: [&str; 2] = ["exp(-((q - p)/W)^2)", "(q - p)*exp(-((q - p)/W)^2)"];

/// A spring between two points at a and b from the joint's axis, W = (a² + b²)/2ab, whose tension is not in proportion to its length: the part that is
/// in proportion looks like a body's weight.
const LEVER: &str = "sin(q - p)/sqrt(W - cos(q - p))";
/// Levers from nearly equal ones to four to one, by what comes of them at the least: W − 1.
const BENDS: [f64; 5] = [0.05, 0.13, 0.3, 0.6, 1.1];
/// Where the lever points away from the spring: anywhere.
const TURN: Grid = Grid::Evenly {
    least: -std::f64::consts::PI,
    most: std::f64::consts::PI,
    count: 24,
};

/// Torques of their own.
const ALONE: [(&str, Option<Grid>); 3] = [
    ("tanh(dq/p)", Some(Grid::SpeedsOfMotion)),
    ("exp(-abs(dq)/p)*sign(dq)", Some(Grid::SpeedsOfMotion)),
    ("abs(dq)*dq", None),
];

/// By another joint of the limb, `X`. With any carrier.
const BY_ANOTHER: [&str; 4] = ["q.X", "q.X^2", "q*q.X", "sin(q.X)"];

/// Torques by another joint's motion, and by that of a link that both turn, whichever way their axes point.
const OF_ANOTHER: [&str; 5] = [
    "dq.X",
    "sign(dq.X)",
    "abs(dq.X)*dq.X",
    "(dq + dq.X)*abs(dq + dq.X)",
    "(dq - dq.X)*abs(dq - dq.X)",
];

/// A function of a joint's motion with one parameter, `p`, at most: a width is a number in it.
pub(crate) struct Factor(Expression);

impl Factor {
    /// Of a text at a joint.
    pub(crate) fn read(text: &str, names: Names) -> Result<Self, FormulaError> {
        Ok(Self(parse(text, names)?.expression))
    }

    /// Its value where the limb's joints are in these states.
    pub(crate) fn at(&self, joints: &[JointState<f64>], own: usize, p: f64) -> f64 {
        value(&self.0, joints, own, &[p])
    }

    /// The same at many instants.
    pub(crate) fn at_all(&self, instants: &[Vec<JointState<f64>>], own: usize, p: f64) -> Vec<f64> {
        values(&self.0, instants, own, &[p])
    }
}

/// A term: its factors, and the text of the torque.
#[derive(Clone)]
pub(crate) struct Term {
    /// What multiplies; nothing for a torque of its own.
    pub(crate) carrier: Option<&'static str>,
    /// How that depends on the rest: one factor, or a sine and a cosine.
    pub(crate) factors: Vec<String>,
    /// Where its parameter is sought.
    pub(crate) grid: Option<Grid>,
    /// Where it begins or ends, if it does at its parameter.
    pub(crate) border: Option<Border>,
    /// Of one of [`AT_PLACES`] that and its width, rad, or of [`LEVER`] that and its bend: a parameter of the torque, `w`, and a number of the factor.
    width: Option<(&'static str, f64)>,
}

impl Term {
    /// Its width, rad, or its bend, if it has one.
    pub(crate) fn width(&self) -> Option<f64> {
        self.width.map(|(_, width)| width)
    }

    /// The same with another width.
    pub(crate) fn with_width(mut self, width: f64) -> Self {
        if let Some((text, own)) = &mut self.width {
            *own = width;
            self.factors = vec![text.replace('W', &own.to_string())];
        }
        self
    }

    /// Its factors as the torque has them, by all of its parameters.
    fn symbols(&self) -> Vec<String> {
        match self.width {
            Some((text, _)) => vec![text.replace('W', "w")],
            None => self.factors.clone(),
        }
    }

    /// The text of the torque: `c*(…)*sign(dq)`.
    pub(crate) fn text(&self) -> String {
        let coefficients = match self.factors.len() {
            1 => &["c"][..],
            _ => &["a", "b"],
        };
        let carrier = self.carrier.map_or(String::new(), |by| format!("*{by}"));
        let of =
            |(coefficient, factor): (&&str, String)| format!("{coefficient}*{factor}{carrier}");
        let all: Vec<String> = coefficients.iter().zip(self.symbols()).map(of).collect();
        all.join(" + ")
    }

    /// A name for it, of the letters of its factors.
    pub(crate) fn name(&self) -> String {
        let text = format!("{} {}", self.symbols()[0], self.carrier.unwrap_or_default());
        let words = text.split(|c: char| !c.is_ascii_alphanumeric());
        let words: Vec<String> = (words.filter(|word| !word.is_empty()))
            .map(str::to_ascii_lowercase)
            .collect();
        words.join("_")
    }

    /// How many numbers it has.
    pub(crate) fn numbers(&self) -> usize {
        let shapes = usize::from(self.grid.is_some()) + usize::from(self.width.is_some());
        self.factors.len() + shapes
    }

    /// How much there is to its text: what is as good and has less is preferred.
    pub(crate) fn complexity(&self) -> usize {
        self.text().chars().filter(|c| !c.is_whitespace()).count()
    }
}

/// All terms at a joint of a limb with these joints; `travel` is how far the joint moves, rad.
pub(crate) fn terms(names: Names, travel: f64) -> Vec<Term> {
    let mut all = Vec::new();
    let mut put = |carrier: &'static str, factors: Vec<String>, grid: Option<Grid>, border| {
        all.push(Term {
            carrier: Some(carrier).filter(|carrier| !carrier.is_empty()),
            factors,
            grid,
            border,
            width: None,
        });
    };
    for carrier in std::iter::once("").chain(CARRIERS) {
        for (text, grid, border) in ANYWHERE {
            // A multiple of the position alone is the catalogue's spring.
            if (carrier, text) != ("", "q") {
                put(carrier, vec![text.to_owned()], grid, border);
            }
        }
        let pair = ["sin(p*q)", "cos(p*q)"].map(str::to_owned);
        put(carrier, pair.to_vec(), Some(Grid::Frequencies), None);
        for other in others(names) {
            for text in BY_ANOTHER {
                put(carrier, vec![text.replace('X', &other)], None, None);
            }
        }
    }
    for (text, grid) in ALONE {
        put("", vec![text.to_owned()], grid, None);
    }
    for other in others(names) {
        for text in OF_ANOTHER {
            put("", vec![text.replace('X', &other)], None, None);
        }
    }
    let mut put = |carrier, (text, grid): (&'static str, Grid), width: f64| {
        let term = Term {
            carrier,
            factors: Vec::new(),
            grid: Some(grid),
            border: None,
            width: Some((text, 0.0)),
        };
        all.push(term.with_width(width));
    };
    for carrier in [None, Some("sign(dq)")] {
        for text in AT_PLACES {
            for share in WIDTHS {
                put(carrier, (text, Grid::Positions), share * travel);
            }
        }
    }
    for bend in BENDS {
        put(None, (LEVER, TURN), 1.0 + bend);
    }
    all
}

/// The other joints of the limb, as texts name them.
fn others(names: Names) -> Vec<String> {
    let of = |name: &str| {
        let is_plain = name.chars().all(|c| c.is_alphanumeric() || c == '_');
        if is_plain {
            name.to_owned()
        } else {
            format!("\"{name}\"")
        }
    };
    let all = names.joints.iter().enumerate();
    all.filter(|(n, _)| *n != names.own)
        .map(|(_, name)| of(name))
        .collect()
}
