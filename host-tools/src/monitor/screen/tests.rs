//! The layouts, in a terminal of 80 × 24, in a narrow one, and in none worth the name.

use proprio_core::go2::Leg;
use proprio_core::wire::{DeviceMessage, HostMessage};
use ratatui::Terminal;
use ratatui::backend::TestBackend;

use super::{Page, Screen, draw};
use crate::device::Robot;
use crate::device::{Desktop, Device};
use crate::monitor::View;
use proprio_simulator::hidden::typical;

/// What is known after some seconds of a device that hears these legs.
fn watched(legs: &[Leg], seconds: u64) -> View {
    let mut view = View::default();
    let mut device = Desktop::<f64>::new();
    view.hear(&DeviceMessage::Hello(device.hello().clone()));
    let mut effects = typical(legs);
    let hide: proprio_simulator::Hide = "quadratic_drag:FR_calf=0.1".parse().unwrap();
    effects.extend(hide.on(legs).unwrap());
    let robot = Robot::new(legs, effects, 3);
    device.command(&HostMessage::RequestHello).unwrap();
    for step in robot.steps().take((500 * seconds) as usize) {
        device
            .play(&step.unwrap(), &mut |message| view.hear(&message))
            .unwrap();
    }
    view
}

fn drawn(view: &View, screen: &Screen, width: u16, height: u16) -> Vec<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(frame, view, screen)).unwrap();
    let buffer = terminal.backend().buffer().clone();
    let row = |y| (0..width).map(|x| buffer[(x, y)].symbol()).collect();
    (0..height).map(row).collect()
}

#[test]
fn everything_fits_a_terminal_of_80_by_24() {
    let view = watched(&Leg::ALL, 20);
    let screen = Screen {
        source: "sim".to_owned(),
        ..Screen::default()
    };
    let rows = drawn(&view, &screen, 80, 24);
    let text = rows.join("\n");
    assert!(rows[0].starts_with("proprio sim desktop"), "{text}");
    for joint in ["FR_hip", "FR_calf", "RL_calf"] {
        let row = rows.iter().find(|row| row.starts_with(joint));
        assert_eq!(row.unwrap().matches('±').count(), 4, "{text}");
    }
    assert!(rows[1].contains("coulomb") && rows[1].contains("bias"));
    assert!(text.contains("what the model lacks") && text.contains("events"));
    assert!(text.contains("▸MISSING quadratic_drag:FR_calf"), "{text}");
    assert!(rows[21].starts_with("bus  FR 500/s 0 lost"), "{text}");
    assert!(rows[22].starts_with("link "), "{text}");
    assert!(rows[23].starts_with("q quit · tab page"), "{text}");
}

#[test]
fn a_legs_page_has_error_bars_against_the_cad_and_scrolls() {
    let view = watched(&Leg::ALL[..1], 4);
    let mut screen = Screen {
        page: Page::Leg(Leg::FR),
        ..Screen::default()
    };
    let rows = drawn(&view, &screen, 90, 24);
    let text = rows.join("\n");
    assert!(
        rows[1].contains("estimate") && rows[1].contains("CAD"),
        "{text}"
    );
    assert!(
        rows[2].starts_with("m:FR_hip kg") && rows[2].contains('●'),
        "{text}"
    );
    screen.scroll = 1_000;
    let end = drawn(&view, &screen, 90, 24).join("\n");
    assert!(end.contains("bias:FR_calf N m"), "{end}");
    screen.page = Page::Leg(Leg::RL);
    assert!(
        drawn(&view, &screen, 90, 24)
            .join("\n")
            .contains("no data of this leg yet")
    );
}

#[test]
fn a_narrow_terminal_shows_the_residuals_and_any_size_is_drawn() {
    let view = watched(&Leg::ALL[..2], 12);
    let screen = Screen::default();
    let rows = drawn(&view, &screen, 46, 24);
    let text = rows.join("\n");
    let row = rows.iter().find(|row| row.starts_with("FR_calf")).unwrap();
    assert_eq!(row.matches('±').count(), 1, "{text}");
    assert!(row.contains("0."), "{text}");
    assert!(text.contains("quadratic_drag"), "{text}");
    for (width, height) in [(1, 1), (5, 3), (20, 6), (300, 2), (200, 60)] {
        for page in Page::ALL {
            let screen = Screen {
                page,
                ..Screen::default()
            };
            drawn(&view, &screen, width, height);
            drawn(&View::default(), &screen, width, height);
        }
    }
}
