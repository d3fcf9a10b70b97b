//! Publications beside the library's results.
//!
//! A study holds what one publication prints, what is claimed of our results
//! beside it, the hypotheses that were tried on differences, and the text of
//! its page. No stage of the library depends on a study.
//!
//! * [`coax2d`]: the paper on the CoAX 2D.

pub mod coax2d;
