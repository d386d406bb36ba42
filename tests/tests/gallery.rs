//! The gallery of `docs/effects.md`: a picture of each formula's torque, and that the formula explains a log in which it is hidden.
//! `PROPRIO_ACCEPT=1` writes the pictures.

use std::fmt::Write as _;
use std::fs;

use proprio_host::formula::{Instant, torque};
use proprio_tests::command::{done, folder, json};

use crate::readme::root;

/// A formula with numbers, and the motion over which it is drawn.
struct Shown {
    /// The picture's name in docs/gallery.
    name: &'static str,
    /// The joint and the formula, as the page has them.
    formula: &'static str,
    /// The parameters' values.
    numbers: &'static [(&'static str, f64)],
    /// The signal along the axis, its unit and its range.
    over: (&'static str, &'static str, [f64; 2]),
    /// Of each curve what another signal is.
    curves: &'static [(&'static str, f64)],
}

const GALLERY: [Shown; 10] = [
    Shown {
        name: "counterbalance",
        formula: "FR_thigh: c*sin(q - q0)/sqrt(w - cos(q - q0))",
        numbers: &[("c", -4.0), ("q0", 0.6), ("w", 1.2)],
        over: ("q", "rad", [-0.5, 3.0]),
        curves: &[("dq", 0.0)],
    },
    Shown {
        name: "cable",
        formula: "FR_calf: c*(q - q0)*abs(q - q0)",
        numbers: &[("c", 3.0), ("q0", -1.7)],
        over: ("q", "rad", [-2.7, -0.9]),
        curves: &[("dq", 0.0)],
    },
    Shown {
        name: "end_stop",
        formula: "FR_thigh: k*max(q - q0, 0)",
        numbers: &[("k", 20.0), ("q0", 1.0)],
        over: ("q", "rad", [0.2, 1.4]),
        curves: &[("dq", 0.0)],
    },
    Shown {
        name: "friction_by_position",
        formula: "FR_calf: a*sin(k*q)*sign(dq) + b*cos(k*q)*sign(dq)",
        numbers: &[("a", 0.25), ("b", 0.1), ("k", 3.0)],
        over: ("q", "rad", [-2.7, -0.9]),
        curves: &[("dq", 1.0), ("dq", -1.0)],
    },
    Shown {
        name: "warming",
        formula: "FR_thigh: c*exp(-t/T)*sign(dq)",
        numbers: &[("c", 0.4), ("T", 4.0)],
        over: ("t", "s", [0.0, 20.0]),
        curves: &[("dq", 1.0), ("dq", -1.0)],
    },
    Shown {
        name: "change",
        formula: "FR_thigh: c*step(t - t1)*sign(dq)",
        numbers: &[("c", 0.3), ("t1", 7.3)],
        over: ("t", "s", [0.0, 20.0]),
        curves: &[("dq", 1.0), ("dq", -1.0)],
    },
    Shown {
        name: "dead_band",
        formula: "FR_thigh: D*min(max(tau_rigid/d, -1), 1)",
        numbers: &[("D", 0.35), ("d", 0.5)],
        over: ("tau_rigid", "N m", [-1.0, 1.0]),
        curves: &[("dq", 0.0)],
    },
    Shown {
        name: "ripple",
        formula: "FR_thigh: a*tau_rigid*sin(k*q) + b*tau_rigid*cos(k*q)",
        numbers: &[("a", 0.05), ("b", 0.02), ("k", 17.0)],
        over: ("q", "rad", [0.2, 1.4]),
        curves: &[("tau_rigid", 8.0), ("tau_rigid", 4.0)],
    },
    Shown {
        name: "detent",
        formula: "FR_thigh: c*(q - q0)*exp(-((q - q0)/w)^2)",
        numbers: &[("c", 12.0), ("q0", 0.8), ("w", 0.12)],
        over: ("q", "rad", [0.2, 1.4]),
        curves: &[("dq", 0.0)],
    },
    Shown {
        name: "air_drag",
        formula: "FR_calf: c*(dq + dq.FR_thigh)*abs(dq + dq.FR_thigh)",
        numbers: &[("c", 0.01)],
        over: ("dq", "rad/s", [-10.0, 10.0]),
        curves: &[("dq.FR_thigh", 0.0), ("dq.FR_thigh", 5.0)],
    },
];

/// A text with a name's number in its place.
fn with(text: &str, name: &str, value: f64) -> String {
    let is_own = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
    let (mut result, mut rest) = (String::new(), text);
    while let Some(start) = rest.find(is_own) {
        let end = rest[start..]
            .find(|c| !is_own(c))
            .map_or(rest.len(), |n| start + n);
        result += &rest[..start];
        match &rest[start..end] {
            own if own == name => write!(result, "({value})").unwrap(),
            own => result += own,
        }
        rest = &rest[end..];
    }
    result + rest
}

impl Shown {
    /// The formula with its numbers.
    fn numbered(&self) -> String {
        let numbers = self.numbers.iter();
        numbers.fold(self.formula.to_owned(), |text, (name, value)| {
            with(&text, name, *value)
        })
    }

    /// Its torque over the signal, each curve's, N m.
    fn points(&self) -> Vec<Vec<[f64; 2]>> {
        let (signal, _, [from, to]) = self.over;
        let numbered = self.numbered();
        let (_, text) = numbered.split_once(": ").unwrap();
        let curve = |(other, value): &(&str, f64)| {
            // Another joint's signal is a number of the curve.
            let torque = torque(&with(text, other, *value)).unwrap();
            let at = |n: u32| {
                let x = from + (to - from) * f64::from(n) / f64::from(STEPS);
                let of = |own: &str| if own == signal { x } else { 0.0 };
                let instant = Instant {
                    q: of("q"),
                    dq: of("dq"),
                    transmitted: of("tau_rigid"),
                    temperature: 30.0,
                    t: of("t"),
                };
                [x, torque(&instant)]
            };
            (0..=STEPS).map(at).collect()
        };
        self.curves.iter().map(curve).collect()
    }

    /// The picture.
    fn svg(&self) -> String {
        let (signal, unit, [from, to]) = self.over;
        let curves = self.points();
        let most = curves
            .iter()
            .flatten()
            .fold(0.0f64, |most, point| most.max(point[1].abs()));
        let x = |value: f64| LEFT + (WIDTH - LEFT - EDGE) * (value - from) / (to - from);
        let y = |value: f64| 0.5 * HEIGHT - (0.5 * HEIGHT - EDGE) * value / most;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" font-family=\"sans-serif\" \
             font-size=\"10\" fill=\"none\">\n  <title>{}</title>\n  <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n",
            self.numbered().replace('<', "&lt;")
        );
        writeln!(
            svg,
            "  <path d=\"M{LEFT} {0}H{1}M{LEFT} {EDGE}V{2}\" stroke=\"#999\"/>",
            0.5 * HEIGHT,
            WIDTH - EDGE,
            HEIGHT - EDGE
        )
        .unwrap();
        writeln!(svg, "  <g fill=\"#444\">").unwrap();
        for (value, at) in [(most, EDGE + 7.0), (-most, HEIGHT - EDGE)] {
            writeln!(
                svg,
                "    <text x=\"{}\" y=\"{at}\" text-anchor=\"end\">{value:.2}</text>",
                LEFT - 3.0
            )
            .unwrap();
        }
        let below = 0.5 * HEIGHT + 11.0;
        writeln!(
            svg,
            "    <text x=\"{}\" y=\"{EDGE}\">N m</text>",
            LEFT + 3.0
        )
        .unwrap();
        writeln!(
            svg,
            "    <text x=\"{}\" y=\"{below}\">{from}</text>",
            LEFT + 3.0
        )
        .unwrap();
        writeln!(
            svg,
            "    <text x=\"{}\" y=\"{below}\" text-anchor=\"end\">{to} {unit}, {signal}</text>",
            WIDTH - EDGE
        )
        .unwrap();
        svg += "  </g>\n";
        for (curve, colour) in curves.iter().zip(["#1f77b4", "#d62728"]) {
            let points: Vec<String> = curve
                .iter()
                .map(|[at, torque]| format!("{:.1},{:.1}", x(*at), y(*torque)))
                .collect();
            writeln!(
                svg,
                "  <polyline points=\"{}\" stroke=\"{colour}\" stroke-width=\"1.5\"/>",
                points.join(" ")
            )
            .unwrap();
        }
        if self.curves.len() > 1 {
            for ((n, (name, value)), colour) in (0..).zip(self.curves).zip(["#1f77b4", "#d62728"]) {
                let at = HEIGHT - EDGE - 12.0 * f64::from(n);
                writeln!(svg, "  <text x=\"{}\" y=\"{at}\" fill=\"{colour}\" text-anchor=\"end\">{name} = {value}</text>", WIDTH - EDGE).unwrap();
            }
        }
        svg + "</svg>\n"
    }
}

/// Points of a curve: a step is one of a fiftieth of the picture.
const STEPS: u32 = 96;
/// Of the picture and of what stands about the curves, px.
const WIDTH: f64 = 240.0;
const HEIGHT: f64 = 120.0;
const LEFT: f64 = 34.0;
const EDGE: f64 = 8.0;

/// The page's table has these formulas with these pictures, and each picture is of its formula.
#[test]
fn the_gallery_shows_each_formula() {
    let page = fs::read_to_string(root().join("docs/effects.md")).unwrap();
    let gallery = page
        .split("## Gallery")
        .nth(1)
        .unwrap()
        .split("\n## ")
        .next()
        .unwrap();
    let rows: Vec<&str> = gallery
        .lines()
        .filter(|line| line.contains("proprio add"))
        .collect();
    assert_eq!(rows.len(), GALLERY.len());
    for (row, shown) in rows.iter().zip(&GALLERY) {
        let command = format!("`proprio add '{}' -m go2.toml`", shown.formula);
        let picture = format!("](gallery/{}.svg)", shown.name);
        assert!(
            row.contains(&command) && row.contains(&picture),
            "{row}\n{}",
            shown.name
        );
        let path = root().join(format!("docs/gallery/{}.svg", shown.name));
        let svg = shown.svg();
        assert!(svg.len() < 3000, "{}: {} bytes", shown.name, svg.len());
        if std::env::var_os("PROPRIO_ACCEPT").is_some() {
            fs::write(&path, &svg).unwrap();
        }
        let committed = fs::read_to_string(&path).unwrap_or_default();
        assert_eq!(committed, svg, "PROPRIO_ACCEPT=1 writes {}", path.display());
    }
}

/// Hidden in a log, each explains it: what is left of its joint is what is left of a robot that hides nothing.
#[test]
fn the_gallery_explains_what_it_hides() {
    let folder = folder();
    let folder = folder.path();
    let simulate = |log: &str, hide: Option<&str>| {
        let robot = [
            "simulate",
            "--legs",
            "FR",
            "--typical",
            "--with-time",
            "-o",
            log,
        ];
        let hide: Vec<&str> = hide.into_iter().flat_map(|text| ["--hide", text]).collect();
        done(folder, &[&robot[..], &hide].concat());
    };
    let error = |log: &str, model: &str| {
        let fitted = json(&done(folder, &["identify", log, "-m", model, "--json"]));
        fitted["error"]["after"].as_f64().unwrap()
    };
    let add = |model: &str, effects: &[&str]| {
        done(folder, &[&["add"], effects, &["-m", model]].concat());
    };
    const DRIVE: [&str; 4] = ["viscous", "coulomb", "armature", "bias"];
    add("drive.toml", &DRIVE);
    simulate("nothing.csv", None);
    let nothing = error("nothing.csv", "drive.toml");
    // A simulated torque is of its own joint's motion alone.
    for shown in GALLERY
        .iter()
        .filter(|shown| !shown.formula.contains("dq."))
    {
        simulate("log.csv", Some(&shown.numbered()));
        let model = format!("{}.toml", shown.name);
        add(&model, &[&DRIVE[..], &[shown.formula]].concat());
        let left = error("log.csv", &model);
        println!("{}: {left} beside {nothing}", shown.name);
        assert!(
            left < 1.2 * nothing,
            "{}: {left} beside {nothing}",
            shown.name
        );
    }
}
