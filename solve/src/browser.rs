//! What a page's script calls: numbers in, numbers out. The script writes the numbers of [`NestedLimb::write`] where `input` says,
//! calls `load`, and for each choice of effects `choose` and `solve`, whose results lie where `output` says.

use std::cell::RefCell;

use crate::nested::NestedLimb;

#[derive(Default)]
struct State {
    numbers: Vec<f64>,
    limbs: Vec<NestedLimb>,
    /// Of each limb, the effects that are left out.
    out: Vec<Vec<usize>>,
}

thread_local! {
    static STATE: RefCell<State> = RefCell::default();
}

fn with<R>(work: impl FnOnce(&mut State) -> R) -> R {
    STATE.with_borrow_mut(work)
}

/// Room for so many numbers.
#[unsafe(no_mangle)]
extern "C" fn input(numbers: usize) -> *const f64 {
    with(|state| {
        state.numbers = vec![0.0; numbers];
        state.numbers.as_ptr()
    })
}

/// Takes the numbers as limbs, one after the other; how many there are, or zero if they are none.
#[unsafe(no_mangle)]
extern "C" fn load() -> usize {
    with(|state| {
        let numbers = std::mem::take(&mut state.numbers);
        let mut from = &numbers[..];
        state.limbs.clear();
        while !from.is_empty() {
            match NestedLimb::read(&mut from) {
                Some(limb) => state.limbs.push(limb),
                None => return 0,
            }
        }
        state.out = vec![Vec::new(); state.limbs.len()];
        state.limbs.len()
    })
}

/// Puts an effect of a limb into the model, or leaves it out.
#[unsafe(no_mangle)]
extern "C" fn choose(limb: usize, effect: usize, there: u32) {
    with(|state| {
        if let Some(out) = state.out.get_mut(limb) {
            out.retain(|&known| known != effect);
            if there == 0 {
                out.push(effect);
            }
        }
    });
}

/// Fits a limb's model. How many numbers the answer has: of each fold the sums of squares joint by joint, then of each fold θ.
/// Zero if there is no answer.
#[unsafe(no_mangle)]
extern "C" fn solve(limb: usize) -> usize {
    with(|state| {
        let (Some(own), Some(out)) = (state.limbs.get(limb), state.out.get(limb)) else {
            return 0;
        };
        let Some(fit) = own.fit(&|effect| !out.contains(&effect)) else {
            return 0;
        };
        state.numbers = fit.squares.concat();
        state.numbers.extend(fit.theta.concat());
        state.numbers.len()
    })
}

/// Where the answer lies.
#[unsafe(no_mangle)]
extern "C" fn output() -> *const f64 {
    with(|state| state.numbers.as_ptr())
}
