//! The views that are kept for the judgement: by name, or every n-th of the names in their order.

use super::config::TrainConfig;
use super::error::TrainError;

/// Returns for each view whether it is held out.
///
/// Every n-th means the views 0, n, 2n, … in the order of their names, as the loaders of LLFF, 3DGS
/// and 2DGS split. A scene of two views holds none out by that rule.
pub(super) fn held_out(config: &TrainConfig, names: &[String]) -> Result<Vec<bool>, TrainError> {
    let mut held = vec![false; names.len()];
    for wanted in &config.hold_out_names {
        let is_it = |name: &&String| *name == wanted || name.rsplit('/').next() == Some(wanted.as_str());
        let found: Vec<usize> = (0..names.len()).filter(|&view| is_it(&&names[view])).collect();
        if found.len() != 1 {
            let expected = names.first().cloned().unwrap_or_default();
            return Err(TrainError::HeldOut { name: wanted.clone(), found: found.len(), expected });
        }
        held[found[0]] = true;
    }
    if config.hold_out_names.is_empty() && config.hold_out > 1 && names.len() > 2 {
        let mut order: Vec<usize> = (0..names.len()).collect();
        order.sort_by(|&a, &b| names[a].cmp(&names[b]));
        order.into_iter().step_by(config.hold_out).for_each(|view| held[view] = true);
    }
    if held.iter().all(|held| *held) {
        return Err(TrainError::NothingLeft { count: names.len() });
    }
    Ok(held)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_held_out_by_the_order_of_their_names_or_by_name() {
        let mut config = TrainConfig::new("in".into(), "out".into());
        config.hold_out = 3;
        let names = ["b/4.png", "a/1.png", "b/5.png", "a/2.png", "a/3.png"].map(str::to_owned);
        assert_eq!(held_out(&config, &names).unwrap(), [true, true, false, false, false]);
        assert_eq!(held_out(&config, &names[..2]).unwrap(), [false, false]);
        config.hold_out_names = vec!["5.png".to_owned(), "a/3.png".to_owned()];
        assert_eq!(held_out(&config, &names).unwrap(), [false, false, true, false, true]);
        config.hold_out_names = vec!["6.png".to_owned()];
        let error = held_out(&config, &names).unwrap_err().to_string();
        assert!(error.contains("6.png") && error.contains("b/4.png"), "{error}");
        config.hold_out_names = names.to_vec();
        assert!(held_out(&config, &names).unwrap_err().to_string().contains("all 5 views"));
    }
}
