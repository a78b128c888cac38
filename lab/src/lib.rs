//! Ground truth, data sets, evaluation: what prepares a display or a network for the phone.
