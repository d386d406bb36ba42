//! What `proprio simulate --help` says beyond its arguments.

use proprio_simulator::hidden::walking;
use proprio_simulator::poses::PoseKind;
use proprio_simulator::{Description, HiddenKind, Scope};

pub(super) const EXAMPLES: &str = "Examples:
  proprio simulate --typical -o leg.csv
  proprio simulate --legs FR --hide coulomb:FR_calf=0.8 --hide viscous=0.05 -o hidden.csv.gz
  proprio simulate --typical --inertia-error 0.06 --hide stribeck:FR_thigh=0.4,vs=0.05
  proprio simulate --follow motion.csv --typical --inertia-error 0.06 -o fr_log.csv
  proprio simulate --typical --hide payload:FR_calf=0.2,z=-0.1 --hide base_tilt=0.03,pitch=-0.02
  proprio simulate --typical --hide 'FR_calf: 0.3*q*sign(dq)' -o unknown.csv
  proprio simulate --walk trot --typical --inertia-error 0.03 --hide payload:base=2,x=0.05,z=0.07 -o walk.csv
  proprio simulate --poses 30 -m arm.toml --hide elasticity:A2=2e6 -o poses.csv
  proprio simulate --frf -m arm.toml --hide elasticity:elbow=500,damping=0.5 --hide coulomb=1 --slow slow.csv -o frf.csv
  proprio simulate --frf --follow plan.csv -m arm.toml --hide elasticity:elbow=500 -o frf.csv";

/// Examples, then every effect with its parameters.
pub(super) fn long_help() -> String {
    let mut text = format!(
        "{EXAMPLES}\n\nEffects to hide (SI, joint side; one in brackets has this value unless stated):\n"
    );
    for known in [true, false] {
        if !known {
            text += "Effects outside proprio's catalogue:\n";
        }
        let listed = HiddenKind::ALL.iter().map(|kind| kind.description());
        for effect in listed.filter(|effect| effect.in_catalogue == known) {
            text += &usage(effect);
        }
    }
    let walking = walking();
    text += &format!("With --walk: {walking}; payload:base is one on the trunk.");
    let poses: Vec<&str> = PoseKind::ALL.iter().map(|(name, _)| *name).collect();
    text += &format!(
        "\nWith --poses: {} (N m/rad, rad or a share).",
        poses.join(", ")
    );
    text += &format!(
        "\nWith --frf: {}; elasticity:JOINT=k[,damping=d] (N m/rad, N m s/rad), link_elasticity:JOINT=k[,damping=d][,axis=1|2].",
        super::frf::HIDDEN.join(", ")
    );
    text
}

/// `stribeck:JOINT=Fs[,vs=0.05]` and what it is.
fn usage(effect: &Description) -> String {
    let place = match effect.scope {
        Scope::Joint => ":JOINT",
        Scope::Pair => ":THIGH|CALF",
        Scope::Foot => ":CALF",
        Scope::Base => "",
    };
    let first = effect.parameters[0];
    let unit = match first.unit {
        "1" => String::new(),
        unit => format!(" ({unit})"),
    };
    let others = effect.parameters[1..].iter();
    let others: String = others
        .map(|p| format!("[,{}={}]", p.name, p.default))
        .collect();
    let (name, words, value) = (effect.name, effect.words, first.name);
    format!("  {name}{place}={value}{others}\n      {words}{unit}\n")
}
