#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    granulcal_fuzz::survey("fuzz.mcap", bytes);
    granulcal_fuzz::recording("fuzz.mcap", bytes);
});
