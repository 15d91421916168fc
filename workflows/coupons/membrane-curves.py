#!/usr/bin/env python3
"""Writes the reference curves of the membrane coupons: the path of the softening test, the film's tension
tests, the inflated disc.

Needs nothing but Python 3. Run it in this folder; the files are in the repository, so nobody has to. It shares
no code with the plugins."""

from math import cos, exp, log, sqrt

THESIS = "F. Yu, The Prediction of Wrinkle Formation in Non-crimp Fabrics during Double Diaphragm Forming"


def write(name, source, columns, rows):
    with open(name, "w") as out:
        for line in source:
            out.write(f"# {line}\n")
        out.write(",".join(columns) + "\n")
        for row in rows:
            out.write(",".join(f"{v:.10g}" for v in row) + "\n")


# --- softening: the NCF law with its stitch along a path of shear angles ------------------------------------

ONSET, PEAK, END = 0.06, 0.5, 0.75
PATH = [0.6, 0.0, 0.7, 0.2, 0.85, 0.0, 0.5, 0.0]


def yarn(g):
    a = abs(g)
    f = 29.56 * a**5 - 65.56 * a**4 + 137.06 * a**3 + 94.73 * a**2 + 112.19 * a
    return f if g >= 0 else -f


def stitch_curve(g):
    if g < ONSET or g >= END:
        return 0.0
    return 2000 * g - 120 if g < PEAK else 2640 - 3520 * g


def stitch(g, worst):
    """Force at angle g after the largest angle `worst`: secant damage (not in the thesis)."""
    if g <= ONSET:
        return 0.0
    if worst <= PEAK:
        return stitch_curve(g)
    return stitch_curve(worst) * (g - ONSET) / (worst - ONSET) if g < worst else stitch_curve(g)


def softening(folder):
    rows, length, g, worst = [], 0.0, 0.0, 0.0
    dissipated = 0.0
    for target in PATH:
        n = max(1, round(abs(target - g) / 0.001))
        start = g
        for k in range(n + 1):
            now = start + (target - start) * k / n
            if k > 0:
                # Simpson over the small piece: what the frame does is F cos(g) dg.
                mid = 0.5 * (g + now)
                f = []
                for angle in (g, mid, now):
                    worst = max(worst, angle)
                    f.append((yarn(angle) + stitch(angle, worst)) * cos(angle))
                dissipated += (now - g) * (f[0] + 4 * f[1] + f[2]) / 6
                length += abs(now - g)
            elif rows:
                continue
            g = now
            worst = max(worst, g)
            rows.append((length, yarn(g) + stitch(g, worst)))
    write(f"{folder}/reference/path.csv",
          [f"Normalised shear force of the NCF along the path {PATH} rad: {THESIS}, table 3.1,",
           "with secant damage of the stitch beyond its peak (the thesis does not define unloading)"],
          ["path_length [rad]", "normalised_force [N/m]"], rows)
    # All of the stitch's energy is lost once it has passed its end, and the yarns give theirs back.
    n = 200000
    whole = sum(stitch_curve(ONSET + (END - ONSET) * (k + 0.5) / n) * cos(ONSET + (END - ONSET) * (k + 0.5) / n)
                for k in range(n)) * (END - ONSET) / n
    print(f"softening: dissipation along the path {dissipated:.6f} J/m2, of the whole stitch {whole:.6f} J/m2")


# --- film: Marlow, incompressible, plane stress -------------------------------------------------------------

AMPLITUDE, GROWTH, DECAY, LIMIT, THICKNESS = 6.364e6, 0.4451, 7.545, 5.0, 0.08e-3


def tension(e):
    """Uniaxial nominal stress (Pa) over nominal strain."""
    if e > LIMIT:
        slope = AMPLITUDE * (GROWTH * exp(GROWTH * LIMIT) + DECAY * exp(-DECAY * LIMIT))
        return tension(LIMIT) + slope * (e - LIMIT)
    return AMPLITUDE * (exp(GROWTH * e) - exp(-DECAY * e))


def rate(invariant):
    """dU/dI1 (Pa): the uniaxial stretch l with l^2 + 2/l = I1 gives T / (2 (l - l^-2))."""
    d = invariant - 3.0
    if d < 1e-12:
        return AMPLITUDE * (GROWTH + DECAY) / 6.0
    low, high = 1.0, sqrt(invariant)
    l = 1.0 + sqrt(d / 3.0) if d < 1 else high
    for _ in range(60):
        # Newton, kept between the bounds: (l - 1)^2 (l + 2) = d l.
        f = (l - 1.0) ** 2 * (l + 2.0) - d * l
        if f > 0:
            high = l
        else:
            low = l
        slope = 3.0 * l * l - 3.0 - d
        new = l - f / slope if slope > 0 else 0.5 * (low + high)
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - l) < 1e-15 * l:
            break
        l = new
    e = l - 1.0
    return tension(e) / (2.0 * e * (3.0 + 3.0 * e + e * e) / (l * l))


def equibiaxial(e):
    l = 1.0 + e
    return 2.0 * rate(2 * l * l + l**-4) * (l - l**-5)


def planar(e):
    l = 1.0 + e
    return 2.0 * rate(l * l + 1 + l**-2) * (l - l**-3)


def film(folder):
    measured = {
        "equibiaxial": (lambda e: 6.482e6 * (exp(0.4871 * e) - exp(-12.040 * e)), equibiaxial, 1.0),
        "planar": (lambda e: 7.238e6 * (exp(0.3774 * e) - exp(-8.312 * e)), planar, 2.0),
    }
    columns = ["nominal_strain [1]", "nominal_stress [MPa]"]
    marlow = "closed form of an incompressible Marlow film of the uniaxial curve"
    strains = [5.0 * (k / 400) ** 1.5 for k in range(401)]
    write(f"{folder}/reference/uniaxial.csv", [f"Uniaxial tension: {THESIS}, table 5.1"], columns,
          [(e, tension(e) * 1e-6) for e in strains])
    for name, (curve, law, last) in measured.items():
        strains = [last * (k / 400) ** 1.5 for k in range(401)]
        write(f"{folder}/reference/{name}-marlow.csv", [f"{name}: {marlow}: {THESIS}, table 5.1"], columns,
              [(e, (law(e) if e > 0 else 0.0) * 1e-6) for e in strains])
        write(f"{folder}/reference/{name}-measured.csv", [f"{name}, fit of the measured curve: {THESIS}, table 5.1"],
              columns, [(e, curve(e) * 1e-6) for e in strains])
        n = 2000
        points = [last * (k + 0.5) / n for k in range(n)]
        pairs = [(law(e), curve(e)) for e in points]
        rms = lambda v: sqrt(sum(x * x for x in v) / len(v))
        difference = rms([a - b for a, b in pairs])
        print(f"film {name}: RMSE over rms {100 * difference / rms([b for _, b in pairs]):.2f} %, over mean "
              f"{100 * difference * n / sum(b for _, b in pairs):.2f} %, over largest "
              f"{100 * difference / max(b for _, b in pairs):.2f} %, of relative differences "
              f"{100 * rms([a / b - 1 for a, b in pairs]):.2f} %")


# --- inflated disc: axisymmetric membrane -------------------------------------------------------------------

RADIUS = 0.1


def forces(a, b):
    """Nominal membrane forces (N/m) of the stretches a (meridian) and b (hoop)."""
    ab = 1.0 / (a * a * b * b)
    u = 2.0 * THICKNESS * rate(a * a + b * b + ab)
    return u * (a - ab / a), u * (b - ab / b)


def meridian(force, b, a):
    """The stretch along the meridian whose force is `force`, from the estimate a."""
    for _ in range(50):
        f = forces(a, b)[0] - force
        h = 1e-6 * a
        slope = (forces(a + h, b)[0] - forces(a - h, b)[0]) / (2 * h)
        step = max(-0.2 * a, min(0.2 * a, f / slope))
        a -= step
        if abs(step) < 1e-13 * a:
            break
    return a


def shoot(pole, p, steps=200):
    """Rim radius (m) and height of the centre (m) for the stretch at the pole and the pressure (Pa).

    With N = rho P1 (rho: undeformed radius, P1: nominal meridional force): vertical balance N sin(phi) = p r^2 / 2,
    meridional balance dN/drho = P2 cos(phi), dr/drho = l1 cos(phi), dz/drho = -l1 sin(phi)."""
    start = 1e-6 * RADIUS
    state = [pole * start, forces(pole, pole)[0] * start, 0.0]
    last = [pole]

    def derivative(rho, y):
        r, n, _ = y
        hoop = r / rho
        s = max(-0.999999, min(0.999999, p * r * r / (2 * n)))
        c = sqrt(1 - s * s)
        a = meridian(n / rho, hoop, last[0])
        last[0] = a
        return [a * c, forces(a, hoop)[1] * c, -a * s]

    h = (RADIUS - start) / steps
    for k in range(steps):
        rho = start + h * k
        k1 = derivative(rho, state)
        k2 = derivative(rho + h / 2, [y + h / 2 * d for y, d in zip(state, k1)])
        k3 = derivative(rho + h / 2, [y + h / 2 * d for y, d in zip(state, k2)])
        k4 = derivative(rho + h, [y + h * d for y, d in zip(state, k3)])
        state = [y + h / 6 * (a + 2 * b + 2 * c + d) for y, a, b, c, d in zip(state, k1, k2, k3, k4)]
    return state[0], -state[2]


def disc(folder, steps=100):
    rows = [(0.0, 0.0, 1.0)]
    poles = [1.0 + 0.0005 * 1.1**k for k in range(90)]
    for pole in poles:
        # Secant on the pressure until the rim has its radius.
        e = pole - 1.0
        # First guess: a shallow linear membrane, then what the last two solutions say.
        if len(rows) < 3:
            p0 = 4.1e5 * e**1.5
        else:
            p0 = rows[-1][1] * (rows[-1][1] / rows[-2][1])
        p1 = 1.02 * p0
        r0, r1 = shoot(pole, p0, steps)[0] - RADIUS, shoot(pole, p1, steps)[0] - RADIUS
        for _ in range(40):
            if abs(p1 - p0) < 1e-10 * p1:
                break
            p2 = p1 - r1 * (p1 - p0) / (r1 - r0)
            p2 = max(0.5 * p1, min(2.0 * p1, p2))
            p0, r0, p1 = p1, r1, p2
            r1 = shoot(pole, p1, steps)[0] - RADIUS
            if abs(r1) < 1e-12:
                break
        height = shoot(pole, p1, steps)[1]
        if height > 1.6 * RADIUS or height <= rows[-1][0]:
            break
        rows.append((height, p1, pole))
    limit = next((a for a, b in zip(rows, rows[1:]) if b[1] < a[1]), rows[-1])
    print(f"disc: limit point near {limit[1]:.1f} Pa at {1e3 * limit[0]:.2f} mm, pole stretch {limit[2]:.3f}")
    return rows


def fine(rows, between=5):
    """More points between the solutions: cubics through four neighbours in log p over log h."""
    points = [(log(h), log(p)) for h, p, _ in rows[1:]]
    result = [(0.0, 0.0)]
    for k in range(len(points) - 1):
        near = points[max(0, min(k - 1, len(points) - 4)):][:4]
        for i in range(between):
            x = points[k][0] + (points[k + 1][0] - points[k][0]) * i / between
            y = 0.0
            for a in near:
                weight = 1.0
                for b in near:
                    if b is not a:
                        weight *= (x - b[0]) / (a[0] - b[0])
                y += weight * a[1]
            result.append((exp(x), exp(y)))
    return result + [rows[-1][:2]]


def disc_files(folder):
    rows = fine(disc(folder))
    write(f"{folder}/reference/disc.csv",
          ["Clamped disc of 100 mm radius and 0.08 mm thickness, incompressible Marlow film of the uniaxial curve of",
           f"{THESIS}, table 5.1: axisymmetric membrane equations by shooting (membrane-curves.py)"],
          ["centre_height [mm]", "pressure [kPa]"], [(1e3 * r[0], 1e-3 * r[1]) for r in rows])


if __name__ == "__main__":
    softening("softening")
    film("film")
    disc_files("inflated-disc")
