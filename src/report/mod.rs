//! Tables and plots of what the stages found.
