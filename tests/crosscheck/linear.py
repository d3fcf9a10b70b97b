#!/usr/bin/env python3
"""Check the linear-model stage against python-control, slycot and SciPy.

    cargo run --release --example crosscheck_linear hover.mat > linear.json
    python3 tests/crosscheck/linear.py linear.json hover.mat

Eigenvalues, frequency responses, residualisation (modred 'matchdc'), Hankel
singular values, balanced truncation and balanced residualisation must agree to
1e-9 relative, zeros to 1e-8. SciPy must read the MAT file, if one is given, and
find the hover model of the appendix in it. Exits with 1 if anything differs.
"""

import json
import sys

import control
import numpy as np
import scipy.io
import scipy.linalg

TOLERANCE = 1e-9
# Zeros come from a generalised eigenvalue problem that is worse conditioned.
ZERO_TOLERANCE = 1e-8

failures = []


def check(case, what, error, tolerance=TOLERANCE):
    """Record one comparison; a NaN is a failure."""
    good = error <= tolerance
    print(f"{'ok  ' if good else 'FAIL'} {error:8.1e}  {case}: {what}")
    if not good:
        failures.append((case, what, error))


def cplx(pairs):
    array = np.asarray(pairs, dtype=float)
    if array.size == 0:
        return np.zeros(0, dtype=complex)
    return array[..., 0] + 1j * array[..., 1]


def distance(found, wanted):
    """Largest relative distance between two sets of numbers, paired greedily."""
    if len(found) != len(wanted):
        return np.inf
    rest = list(wanted)
    scale = max(np.max(np.abs(wanted), initial=0.0), 1e-300)
    worst = 0.0
    for z in sorted(found, key=abs):
        k = int(np.argmin([abs(z - w) for w in rest]))
        worst = max(worst, abs(z - rest.pop(k)) / scale)
    return worst


def relative(found, wanted):
    """Largest difference of a matrix over frequency, each frequency by its norm."""
    found, wanted = np.asarray(found), np.asarray(wanted)
    if found.shape != wanted.shape:
        return np.inf
    norms = np.linalg.norm(wanted, axis=(1, 2))
    return np.max(np.linalg.norm(found - wanted, axis=(1, 2)) / norms)


def response(system, omega):
    return np.moveaxis(system(1j * np.asarray(omega), squeeze=False), 2, 0)


def independent_residualisation(system, keep):
    """python-control's modred, which drops states by index."""
    drop = [i for i in range(system.nstates) if i not in keep]
    return control.modred(system, drop, method="matchdc")


def check_case(case):
    name, model = case["name"], case["model"]
    system = control.ss(*(np.asarray(model[k], dtype=float) for k in "abcd"))
    omega = case["omega"]

    # Balanced by MATLAB's algorithm, to be fair on badly scaled matrices.
    balanced_a = scipy.linalg.matrix_balance(system.A, permute=False)[0]
    check(name, "eigenvalues", distance(cplx(case["eigenvalues"]), np.linalg.eigvals(balanced_a)))
    check(name, "frequency response", relative(cplx(case["response"]), response(system, omega)))

    states = [s["name"] for s in model["states"]]
    keep = [states.index(k) for k in case["keep"]]
    order = sorted(range(len(keep)), key=lambda i: keep[i])
    theirs = independent_residualisation(system, keep)
    ours = {k: np.asarray(case["residualised"][k], dtype=float) for k in "abcd"}
    a = ours["a"][np.ix_(order, order)]
    b, c = ours["b"][order, :], ours["c"][:, order]
    for what, mine, other in [
        ("A", a, theirs.A),
        ("B", b, theirs.B),
        ("C", c, theirs.C),
        ("D", ours["d"], theirs.D),
    ]:
        scale = np.max(np.abs(other))
        error = np.max(np.abs(mine - other))
        check(name, f"matchdc {what}", error / scale if scale > 0 else error)

    size = case["zeros_size"]
    square = control.ss(system.A, system.B[:, :size], system.C[:size, :], system.D[:size, :size])
    check(
        name,
        "zeros",
        distance(cplx(case["zeros"]), np.asarray(control.zeros(square))),
        ZERO_TOLERANCE,
    )

    if case["stable"]:
        hankel = np.sort(control.hankel_singular_values(system))[::-1]
        mine = np.asarray(case["hankel"])
        check(name, "Hankel singular values", np.max(np.abs(mine - hankel)) / hankel[0])
        for reduction in case["balanced"]:
            method = {"balanced": "truncate", "balanced-residualize": "matchdc"}[reduction["method"]]
            theirs = control.balred(system, reduction["order"], method=method)
            check(
                name,
                f"balred {method}, order {reduction['order']}",
                relative(cplx(reduction["response"]), response(theirs, omega)),
            )


def check_mat(path):
    """The hover model of the paper's appendix, in ft, s, rad and percent."""
    mat = scipy.io.loadmat(path)

    def names(key):
        return [str(cell[0]) for cell in mat[key][:, 0]]

    def same(what, found, wanted):
        check("MAT file", what, 0.0 if found == wanted else np.inf)

    same("state names", names("state_names"), ["u", "v", "w", "p", "q", "r", "phi", "theta"])
    same("state units", names("state_units"), ["ft/s"] * 3 + ["rad/s"] * 3 + ["rad"] * 2)
    same("input names", names("input_names"), ["lat", "lon", "col", "ped"])
    same("input units", names("input_units"), ["%"] * 4)
    same("shapes", [mat[k].shape for k in "ABCD"], [(8, 8), (8, 4), (8, 8), (8, 4)])
    check("MAT file", "A(u, theta)", abs(mat["A"][0, 7] + 32.17) / 32.17)
    check("MAT file", "B(w, col)", abs(mat["B"][2, 2] + 1.6552) / 1.6552)
    check("MAT file", "C", np.max(np.abs(mat["C"] - np.eye(8))))
    check("MAT file", "speed", abs(mat["speed_kt"].item()))


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        cases = json.load(file)
    for case in cases:
        check_case(case)
    if len(sys.argv) > 2:
        check_mat(sys.argv[2])
    if not cases:
        failures.append(("file", "no case", np.inf))
    print(f"{len(failures)} differences" if failures else "all agree")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
