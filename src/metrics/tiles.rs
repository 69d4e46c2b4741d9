//! (placeholder until the bootstrap is merged)
use super::{Metric, regions::Regions};
/// x
pub fn of_one_frame(
    regions: &Regions,
    _resolution: [u32; 2],
    measure: impl Fn(&Regions) -> Vec<Metric>,
) -> Vec<Metric> {
    measure(regions)
}
