"""filterpy's UKF on six states behind three cables: microseconds per predict and update, the median of several batches.

The model has links of constant inertia that do not couple, and gravity as a sine; `filter.rs` has the same for the comparison.
"""

import sys
import time

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

STEPS = int(sys.argv[1]) if len(sys.argv) > 1 else 100
STEP_S = 1e-3
STIFFNESS = np.array([720e3, 88e3, 9.25e3])
DAMPING = np.array([4000.0, 1380.0, 400.0])
RADIUS = np.array([63.095e-3, 56.297e-3, 1.0])
INERTIA = np.array([0.2, 0.09, 0.407])
GRAVITY = np.array([1.1, 0.6, 3.3])
COULOMB = np.array([0.505, 0.49, 0.53])
VISCOUS = np.array([0.005, 0.005, 0.005])
FADING = np.array([5e-3, 5e-3, 1e-3])


def slope(state, wound, wound_rate):
    position, rate = state[:3], state[3:]
    stretch = wound - RADIUS * position
    tension = STIFFNESS * (np.exp(stretch) - np.exp(-stretch)) + 2.0 * DAMPING * (wound_rate - RADIUS * rate)
    force = RADIUS * tension - GRAVITY * np.sin(position) - COULOMB * np.tanh(rate / FADING) - VISCOUS * rate
    return np.concatenate([rate, force / INERTIA])


def transition(state, dt, wound, wound_rate):
    k1 = slope(state, wound, wound_rate)
    k2 = slope(state + 0.5 * dt * k1, wound + 0.5 * dt * wound_rate, wound_rate)
    k3 = slope(state + 0.5 * dt * k2, wound + 0.5 * dt * wound_rate, wound_rate)
    k4 = slope(state + dt * k3, wound + dt * wound_rate, wound_rate)
    return state + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)


def main():
    position = np.array([0.8, 1.5, 0.35])
    wound, wound_rate = RADIUS * position, np.array([0.01, -0.01, 0.01])
    points = MerweScaledSigmaPoints(6, alpha=1.0, beta=2.0, kappa=0.0)
    ukf = UnscentedKalmanFilter(dim_x=6, dim_z=3, dt=STEP_S, hx=lambda x: x[:3], fx=transition, points=points)
    ukf.x = np.concatenate([position, np.zeros(3)])
    ukf.P = np.diag([4e-6, 4e-6, 2.5e-7, 4e-4, 4e-4, 2.5e-5])
    ukf.Q = np.diag([1e-10, 1e-10, 1e-11, 1e-6, 1e-6, 1e-8])
    ukf.R = np.diag([1e-4, 1e-4, 1e-6])
    times = []
    for _ in range(5):
        started = time.perf_counter()
        for _ in range(STEPS):
            ukf.predict(wound=wound, wound_rate=wound_rate)
            ukf.update(position)
        times.append((time.perf_counter() - started) / STEPS * 1e6)
    print(f"{np.median(times):.3f}")


main()
