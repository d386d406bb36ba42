//! What a calibration makes of the model: fixtures, corrections in the frames' own axes, effects.

use nalgebra::{Matrix3, Vector3};

use super::chain::{Chain, State, inverse};
use super::columns::{Column, Unknown};
use super::error::CalibrateError;
use super::poses::{Carrier, Poses};
use super::witnesses::Witnessed;
use crate::model::{Fixture, JointQuantity as Q, Model, Tool, Witness};

/// Frame corrections along the frame's own axes: value, standard deviation and prior's.
pub(super) fn along_frame(
    chain: &Chain,
    values: &[(Column, f64, f64)],
    joint: usize,
    quantity: Q,
    state: &State,
) -> Option<(f64, f64, f64)> {
    let (k, turns) = match quantity {
        Q::Shift(k) => (k, false),
        Q::Turn(k) => (k, true),
        _ => return None,
    };
    let (mut std, mut prior, mut any) = (0.0_f64, 0.0_f64, false);
    for (column, _, deviation) in values {
        let n = match column.unknown {
            Unknown::Shift(j, n) if j == joint && !turns => n,
            Unknown::Turn(j, n) if j == joint && turns => n,
            _ => continue,
        };
        let share = chain.directions(joint)[n][k];
        std += (share * deviation).powi(2);
        prior += (share * column.prior).powi(2);
        any |= share.abs() > 1e-9;
    }
    any.then(|| {
        (
            state.joints[joint][quantity.index()],
            std.sqrt(),
            prior.sqrt(),
        )
    })
}

/// The model with all values.
pub(super) fn applied(
    chain: &Chain,
    poses: &Poses,
    model: &Model,
    Witnessed { fit, own }: &Witnessed,
    carriers: &[Carrier],
) -> Result<Model, CalibrateError> {
    let all = fit.values(chain);
    let mut model = model.clone();
    model.clear_kinematics();
    for joint in 0..chain.joints() {
        for quantity in Q::ALL {
            // Of springs, bends and gaps what these poses alone measured: the model combines it with the others' numbers.
            let alone = own.iter().chain(&all);
            let mut alone = alone.filter(|(c, ..)| c.unknown == Unknown::Joint(joint, quantity));
            let alone = alone.next().map(|(_, value, std)| (*value, *std));
            let known = alone.or_else(|| {
                let (value, std, _) = along_frame(chain, &all, joint, quantity, &fit.state)?;
                Some((value, std))
            });
            if let Some((value, std)) = known {
                model.set_joint_quantity(joint, quantity, Witness::Poses, value, std)?;
            }
        }
    }
    let std_of = |unknown: Unknown| {
        let found = all.iter().find(|(c, ..)| c.unknown == unknown);
        found.map(|(_, _, std)| *std)
    };
    let six = |of: &dyn Fn(usize) -> Unknown, axes: &Matrix3<f64>| {
        let three = |from: usize| {
            let own = Vector3::from_fn(|k, _| std_of(of(from + k)).unwrap_or(f64::NAN));
            own.iter().all(|x| x.is_finite()).then_some(own)
        };
        // Shifts are along the fixture's own axes, places along those of what carries it.
        let turned = three(0).map(|std| -> [f64; 3] {
            let along = |k: usize| (0..3).map(|n| (axes[(k, n)] * std[n]).powi(2)).sum::<f64>();
            [0, 1, 2].map(|k| along(k).sqrt())
        });
        (turned, three(3).map(<[f64; 3]>::from))
    };
    let (xyz, rpy) = six(&Unknown::Mount, &fit.state.mount.rotation);
    let mount = Fixture::new(&fit.state.mount, xyz, rpy);
    let tools = poses.targets.iter().enumerate().map(|(t, name)| {
        let carrier = &carriers[t];
        let at = inverse(&carrier.placement).compose(&fit.state.targets[t].placement);
        let (xyz, rpy) = six(&|k| Unknown::Target(t, k), &at.rotation);
        let mut fixture = Fixture::new(&at, xyz, rpy);
        if rpy.is_none() {
            fixture.rpy = [0.0; 3];
        }
        Tool {
            name: name.clone(),
            link: carrier.link.clone(),
            fixture,
        }
    });
    let tools = tools.collect();
    model.set_fixtures(Some(mount), tools);
    Ok(model)
}
