//! The driver and a chip that behaves as the data sheet says.

use crate::registers::*;
use crate::simulated::{Chip, Overrun, Wrong};
use crate::{AccRange, Fault, GyroRange, Lsm6dso, Rate, Reading, SelfTest, Settings};
use embassy_futures::block_on;

const SETTINGS: Settings = Settings {
    rate: Rate::Hz1666,
    acc: AccRange::G16,
    gyro: GyroRange::Dps1000,
};

fn begun(settings: Settings) -> (Chip, Lsm6dso<Chip>) {
    let chip = Chip::new();
    let mut imu = Lsm6dso::new(chip.clone(), settings);
    block_on(imu.begin(&mut chip.clone())).unwrap();
    (chip, imu)
}

/// The next reading, a millisecond later.
fn next(chip: &Chip, imu: &mut Lsm6dso<Chip>) -> Result<Reading, Fault<Overrun>> {
    chip.wait_us(1000);
    imu.read()
}

fn close(is: [f32; 3], should: [f64; 3], within: f64) {
    for (is, should) in is.iter().zip(should) {
        assert!((f64::from(*is) - should).abs() <= within, "{is} {should}");
    }
}

/// The bytes of AN5192's tables of examples, at ±2 g and ±250 degrees a second; they are rounded towards zero.
#[test]
fn the_application_notes_bytes_are_its_values() {
    let settings = Settings {
        rate: Rate::Hz52,
        acc: AccRange::G2,
        gyro: GyroRange::Dps250,
    };
    let (chip, mut imu) = begun(settings);
    // High byte, low byte; mg; degrees a second.
    let acc = [
        ([0x00, 0x00], 0.0),
        ([0x16, 0x69], 350.0),
        ([0x40, 0x09], 1000.0),
        ([0xE9, 0x97], -350.0),
        ([0xBF, 0xF7], -1000.0),
    ];
    let gyro = [
        ([0x00, 0x00], 0.0),
        ([0x2C, 0xA4], 100.0),
        ([0x59, 0x49], 200.0),
        ([0xD3, 0x5C], -100.0),
        ([0xA6, 0xB7], -200.0),
    ];
    for (([a1, a0], mg), ([g1, g0], dps)) in acc.into_iter().zip(gyro) {
        chip.put(0x22, &[g0, g1, 0, 0, 0, 0, a0, a1, 0, 0, 0, 0]);
        let reading = imu.read().unwrap();
        // A count.
        close(reading.acc, [mg * 9.80665e-3, 0.0, 0.0], 6.0e-4);
        close(reading.gyro, [f64::to_radians(dps), 0.0, 0.0], 1.53e-4);
    }
}

#[test]
fn each_range_reads_what_the_chip_feels_within_half_a_count() {
    let acc = [AccRange::G2, AccRange::G4, AccRange::G8, AccRange::G16];
    let gyro = [
        GyroRange::Dps250,
        GyroRange::Dps500,
        GyroRange::Dps1000,
        GyroRange::Dps2000,
    ];
    for (most, (acc, gyro)) in [1.0, 2.0, 4.0, 8.0]
        .into_iter()
        .zip(acc.into_iter().zip(gyro))
    {
        let settings = Settings {
            rate: Rate::Hz3332,
            acc,
            gyro,
        };
        let (chip, mut imu) = begun(settings);
        let rate = [-240.0 * most, 0.4, 17.0 * most];
        let force = [1.9 * most, -0.003, -1.0];
        chip.feel(rate, force);
        chip.0.borrow_mut().celsius = 41.5;
        let reading = next(&chip, &mut imu).unwrap();
        let half = |count: f32| f64::from(count) * 0.501;
        close(reading.gyro, rate.map(f64::to_radians), half(gyro.count()));
        close(reading.acc, force.map(|g| g * 9.80665), half(acc.count()));
        assert_eq!(reading.temperature, 41.5);
    }
}

#[test]
fn each_measurement_is_read_once_at_the_chips_rate() {
    let (chip, mut imu) = begun(SETTINGS);
    let before = chip.0.borrow().measurements;
    let mut readings = 0;
    let mut early = 0;
    for _ in 0..100_000 {
        chip.wait_us(10);
        match imu.read() {
            Ok(_) => readings += 1,
            Err(Fault::NotReady) => early += 1,
            Err(fault) => panic!("{fault:?}"),
        }
    }
    assert_eq!(readings, chip.0.borrow().measurements - before);
    assert!(
        readings > 1_666 && early > 10 * readings,
        "{readings} {early}"
    );
}

#[test]
fn halves_that_come_apart_are_one_reading() {
    let (chip, mut imu) = begun(SETTINGS);
    chip.set_wrong(Wrong::Apart(2));
    chip.feel([1.0, 2.0, 3.0], [0.1, 0.2, 0.3]);
    next(&chip, &mut imu).unwrap();
    chip.set_wrong(Wrong::Apart(10));
    assert_eq!(next(&chip, &mut imu), Err(Fault::NotReady));
}

#[test]
fn what_it_is_told_is_in_the_chips_registers() {
    let (chip, _) = begun(SETTINGS);
    let registers = [
        (CTRL1_XL, 0x84),
        (CTRL2_G, 0x88),
        (CTRL3_C, 0x44),
        (CTRL4_C, 0x0C),
        (CTRL9_XL, 0xE2),
        (COUNTER_BDR_REG1, 0x80),
        (INT1_CTRL, 0x02),
    ];
    for (register, value) in registers {
        assert_eq!(chip.register(register), value, "{register:#x}");
    }
}

#[test]
fn no_chip_another_and_one_that_does_not_hear_are_told() {
    let begin = |wrong| {
        let chip = Chip::new();
        chip.set_wrong(wrong);
        block_on(Lsm6dso::new(chip.clone(), SETTINGS).begin(&mut chip.clone()))
    };
    assert_eq!(begin(Wrong::Nothing), Ok(()));
    for level in [0x00, 0xFF, 0x6B] {
        assert_eq!(begin(Wrong::Silent(level)), Err(Fault::NotThere(level)));
    }
    assert_eq!(begin(Wrong::Deaf), Err(Fault::Refused(CTRL9_XL)));
    assert_eq!(begin(Wrong::Bus), Err(Fault::Bus(Overrun)));
}

#[test]
fn a_measurement_that_is_none_is_refused_and_the_next_one_read() {
    let (chip, mut imu) = begun(SETTINGS);
    let faults = [
        (Wrong::Silent(0xFF), Fault::Garbled),
        (Wrong::Silent(0x00), Fault::NotReady),
        (Wrong::Bus, Fault::Bus(Overrun)),
    ];
    for (wrong, fault) in faults {
        chip.set_wrong(wrong);
        assert_eq!(next(&chip, &mut imu), Err(fault));
        chip.set_wrong(Wrong::Nothing);
        next(&chip, &mut imu).unwrap();
    }
    for force in [[0.0, 16.5, 0.0], [0.0, -16.5, 0.0]] {
        chip.feel([0.0; 3], force);
        assert_eq!(next(&chip, &mut imu), Err(Fault::OverRange));
    }
    chip.feel([0.0, 0.0, 1200.0], [0.0; 3]);
    assert_eq!(next(&chip, &mut imu), Err(Fault::OverRange));
}

/// It is silent, and measures again once it is begun again.
#[test]
fn a_chip_that_lost_its_power_is_begun_again() {
    let (chip, mut imu) = begun(SETTINGS);
    next(&chip, &mut imu).unwrap();
    chip.power_cycle();
    assert_eq!(next(&chip, &mut imu), Err(Fault::NotReady));
    block_on(imu.begin(&mut chip.clone())).unwrap();
    next(&chip, &mut imu).unwrap();
}

#[test]
fn the_self_test_finds_the_axis_that_is_stuck() {
    let (chip, mut imu) = begun(SETTINGS);
    chip.0.borrow_mut().shaking = [0.05, 0.002];
    let mut test = || block_on(imu.self_test(&mut chip.clone())).unwrap();
    assert_eq!(test(), SelfTest::Passed);
    for axis in 0..6 {
        chip.set_wrong(Wrong::Stuck(axis));
        assert_eq!(test(), SelfTest::Failed(axis as u8));
    }
    chip.set_wrong(Wrong::Nothing);
    for shaking in [[20.0, 0.0], [0.0, 0.1]] {
        chip.0.borrow_mut().shaking = shaking;
        assert_eq!(test(), SelfTest::Moves);
    }
    // It measures as before.
    assert_eq!(
        [chip.register(CTRL1_XL), chip.register(CTRL2_G)],
        [0x84, 0x88]
    );
    assert_eq!(chip.register(CTRL5_C), 0);
    chip.0.borrow_mut().shaking = [0.0; 2];
    close(
        next(&chip, &mut imu).unwrap().acc,
        [0.0, 0.0, 9.80665],
        3e-3,
    );
}
