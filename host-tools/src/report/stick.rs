//! A moving figure of limbs.

use std::fmt::Write;

use super::escape;
use super::figure::colour;
use super::section::Section;

/// A limb's joints and its end as points of the base's frame, m, frame by frame.
#[derive(Debug, Clone)]
pub struct Skeleton {
    /// The limb's name.
    pub limb: String,
    /// Whether the robot stands on feet.
    pub has_feet: bool,
    /// `frames[k][n]`: point n at frame k.
    pub frames: Vec<Vec<[f64; 3]>>,
}

/// Frames a second of the moving figure.
pub const FRAMES: f64 = 30.0;

/// The limbs as they move, from the side and from the front.
pub fn figure_of(skeletons: &[Skeleton]) -> Section {
    let points = || skeletons.iter().flat_map(|s| s.frames.iter().flatten());
    let span = |n: usize| {
        let (low, high) = points().fold((0.0f64, 0.0f64), |(low, high), p| {
            (low.min(p[n]), high.max(p[n]))
        });
        (low - 0.05, high + 0.05)
    };
    let spans = [span(0), span(1), span(2)];
    let mut picture = String::from(
        "<p><button type=\"button\" id=\"play\">Pause</button></p>\n<div class=\"sticks\">",
    );
    let has_feet = skeletons.iter().all(|s| s.has_feet);
    let views = match has_feet {
        true => ["front to the right", "left to the right"],
        false => ["x of the base to the right", "y of the base to the right"],
    };
    for (name, across, ahead) in [("side", 0, views[0]), ("front", 1, views[1])] {
        let ((left, right), (low, high)) = (spans[across], spans[2]);
        let _ = write!(
            picture,
            "<figure><svg class=\"stick\" data-across=\"{across}\" role=\"img\" aria-label=\"the limbs from the {name}\" \
             viewBox=\"{left:.3} {:.3} {:.3} {:.3}\">\
             <path d=\"M-.03 0H.03M0-.03V.03\" stroke=\"currentColor\" stroke-width=\".006\"/>",
            -high,
            right - left,
            high - low,
        );
        for (n, skeleton) in skeletons.iter().enumerate() {
            let _ = write!(
                picture,
                "<polyline fill=\"none\" stroke=\"var(--{})\" stroke-width=\".012\" stroke-linejoin=\"round\" \
                 stroke-linecap=\"round\"><title>{}</title></polyline>",
                colour::MODELS[n % colour::MODELS.len()].trim_start_matches('@'),
                escape::html(&skeleton.limb)
            );
        }
        let _ = write!(
            picture,
            "</svg><figcaption>from the {name}, {ahead}</figcaption></figure>"
        );
    }
    let frames: Vec<String> = skeletons.iter().map(frames_of).collect();
    let _ = writeln!(
        picture,
        "</div><script>{}</script>",
        SCRIPT.replace("@frames", &format!("[{}]", frames.join(",")))
    );
    Section {
        id: "figure",
        title: "The motion",
        text: format!(
            "The limbs as the motion moves them, over one period in true time; the cross is the base, the last point {}.",
            if has_feet {
                "a foot"
            } else {
                "the end of the last link"
            }
        ),
        html: picture,
        legend: Vec::new(),
        figures: Vec::new(),
        table: None,
        columns: 1,
        ..Section::default()
    }
}

/// Numbers alone, in millimetres' digits: nothing from outside gets into the script.
fn frames_of(skeleton: &Skeleton) -> String {
    let point = |p: &[f64; 3]| format!("[{:.3},{:.3},{:.3}]", p[0], p[1], p[2]);
    let frame = |points: &Vec<[f64; 3]>| {
        let points: Vec<String> = points.iter().map(point).collect();
        format!("[{}]", points.join(","))
    };
    let frames: Vec<String> = skeleton.frames.iter().map(frame).collect();
    format!("[{}]", frames.join(","))
}

/// Draws the frame of the moment into every figure; stands still where the reader asks for little motion.
const SCRIPT: &str = "(()=>{const limbs=@frames,rate=30;const button=document.getElementById('play');\
let moving=!matchMedia('(prefers-reduced-motion: reduce)').matches,begun=performance.now(),stood=0;\
const draw=(k)=>{for(const svg of document.querySelectorAll('svg.stick')){const across=+svg.dataset.across;\
svg.querySelectorAll('polyline').forEach((line,n)=>{const points=limbs[n][k%limbs[n].length];\
line.setAttribute('points',points.map((p)=>`${p[across]},${-p[2]}`).join(' '));});}};\
const step=(now)=>{if(!moving)return;draw(Math.max(0,Math.floor((now-begun)/1000*rate)));requestAnimationFrame(step);};\
const label=()=>{button.textContent=moving?'Pause':'Play';};\
button.onclick=()=>{moving=!moving;label();if(moving){begun=performance.now()-stood;requestAnimationFrame(step);}\
else{stood=performance.now()-begun;}};draw(0);label();if(moving)requestAnimationFrame(step);})();";
