//! Fixed-step Runge–Kutta integration of known order.
