//! Tables and plots of what the stages found.
//!
//! Nothing here computes or knows another stage: it draws the numbers it is
//! given, in the units it is given.
//!
//! * [`plot`]: figures of panels, written as SVG.
//! * [`figures`]: the ready-made figures of this field, from plain data.
//! * [`three_view`]: a vehicle from port, from ahead and from above.
//! * [`law`]: block diagrams of the control law.
//! * [`table`]: aligned text tables, also as Markdown and CSV.
//! * [`html`]: a page of text, figures and tables in one file.
//! * [`progress`]: a progress bar that only a person at a terminal sees.

pub mod figures;
pub mod html;
pub mod law;
pub mod plot;
pub mod progress;
pub mod table;
pub mod three_view;
