"""Margins and sensitivities of three loops by python-control.

Prints the numbers that tests/control_metrics.rs holds the metrics to:
    python tests/crosscheck/margins.py
"""

import control
import numpy as np

s = control.tf("s")
LOOPS = {
    # Attitude loop with actuator and a second-order Pade of 0.1 s.
    "attitude": (2.0 * s**2 + 2.2 * s + 0.4) / s**3
    * 900 / (s**2 + 48 * s + 900)
    * (1 - 0.05 * s + 0.01 / 12 * s**2) / (1 + 0.05 * s + 0.01 / 12 * s**2),
    # Unstable plant: margins up and down.
    "unstable": 6 * (s + 1.5) / ((s - 0.8) * (s + 0.2)) * 20 / (s + 20) * 8 / (s + 8),
    # Resonance: several crossings of 0 dB.
    "resonant": 1.2 / s * (s**2 + 0.5 * s + 9) / (s**2 + 0.3 * s + 16) * 25 / (s + 25),
}

w = np.geomspace(1e-3, 1e3, 400_001)
for name, loop in LOOPS.items():
    gm, pm, sm, wpc, wgc, ws = control.stability_margins(loop, returnall=True)
    up = min([g for g in gm if g > 1], default=np.inf)
    down = min([1 / g for g in gm if 0 < g < 1], default=np.inf)
    disk = control.disk_margins(loop, w, skew=0.0)[0]
    sensitivity = np.abs(control.frequency_response(1 / (1 + loop), w).frdata[0, 0])
    level = np.sqrt(0.5)
    k = np.where((sensitivity[:-1] < level) & (sensitivity[1:] >= level) & (w[:-1] > 0.08))[0]
    drb = w[k[0]] if len(k) else np.nan
    print(
        f'("{name}", crossover {max(wgc):.6f}, pm_deg {min(abs(np.array(pm))):.5f}, '
        f"up {up:.6f}, down {down:.6f}, disk {disk:.6f}, drb {drb:.5f}, peak {sensitivity.max():.6f})"
    )
