// Copyright 2026 The masmc_ros authors
// SPDX-License-Identifier: Apache-2.0

// The paper's scenario (rasmc, tanh) in C with closed forms and libm: a reference for benchmarks,
// not a part of the package. Prints the best time of a 20 s run in ms, the RMS errors
// in mm, and the mean processor time of a run in ms.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define N 20001
static const double r = 0.0508, b = 0.182, l = 0.116, L1 = 0.514, L2 = 0.362, T = 1e-3;
static const double theta[7] = {21.353000310000624, 0.36151294256000002, 0.42108, 1.1951,
                                0.26001, 0.59325996, 0.08598243};
static double X[N][7], V[N][4], TAU[N][4], E[N][4], S[N][4], TH[N][7], REF[N][12];

static void forward(const double q[7], const double v[4], const double tau[4], double dq[7],
                    double dv[4]) {
    double c0 = cos(q[2]), s0 = sin(q[2]), c1 = cos(q[5]), s1 = sin(q[5]);
    double c2 = cos(q[6]), s2 = sin(q[6]), c12 = c1 * c2 - s1 * s2, s12 = s1 * c2 + c1 * s2;
    double u = 0.5 * r * (v[0] + v[1]), w = 0.5 * r / b * (v[0] - v[1]);
    double A = w + v[2], B = A + v[3], M = theta[0], J = theta[1], c = theta[2];
    double p1 = theta[3], p2 = theta[4];
    double w1 = p1 * A * A, w2 = p2 * B * B, pull = l * w * w, slide = w * u;
    double fu = (tau[0] + tau[1]) / r + c * w * w + w1 * c1 + w2 * c12;
    double fw = b * (tau[0] - tau[1]) / r - tau[2] - c * slide + l * (w1 * s1 + w2 * s12);
    double fa = tau[2] - tau[3] - (p1 * (s1 * pull + c1 * slide) - L1 * s2 * w2);
    double fb = tau[3] - p2 * (s12 * pull + c12 * slide + L1 * s2 * A * A);
    double ua = -p1 * s1, ub = -p2 * s12, wa = l * p1 * c1, wb = l * p2 * c12, ab = L1 * p2 * c2;
    double aa = theta[5] - ua * ua / M - wa * wa / J, bb = theta[6] - ub * ub / M - wb * wb / J;
    double x = ab - ua * ub / M - wa * wb / J;
    double ra = fa - ua * fu / M - wa * fw / J, rb = fb - ub * fu / M - wb * fw / J;
    double det = 1.0 / (aa * bb - x * x), da = (bb * ra - x * rb) * det;
    double db = (aa * rb - x * ra) * det;
    double du = (fu - ua * da - ub * db) / M, dw = (fw - wa * da - wb * db) / J;
    dq[0] = u * c0; dq[1] = u * s0; dq[2] = w;
    for (int i = 0; i < 4; i++) dq[3 + i] = v[i];
    dv[0] = (du + b * dw) / r; dv[1] = (du - b * dw) / r; dv[2] = da - dw; dv[3] = db - da;
}

static void disturbed(const double tau[4], double t, double out[4]) {
    out[0] = tau[0] + 1.5 * sin(3.0 * t); out[1] = tau[1] + 1.5 * cos(3.0 * t);
    out[2] = tau[2] + 3.0 * sin(1.5 * t); out[3] = tau[3] + 3.0 * cos(1.5 * t);
}

static void inverse(const double c[6], double ex, double ey, double fx, double fy, double o[4]) {
    // c: c0 s0 c1 s1 c12 s12; quasi-velocities u, w, A, B of a task velocity.
    double a = c[0] * ex + c[1] * ey, d = c[0] * ey - c[1] * ex;
    double f = c[0] * fx + c[1] * fy, g = c[0] * fy - c[1] * fx;
    double s2 = c[5] * c[2] - c[4] * c[3], dx = a - f, dy = d - g;
    o[0] = f; o[1] = g / l;
    o[2] = (c[4] * dx + c[5] * dy) / (s2 * L1); o[3] = -(c[2] * dx + c[3] * dy) / (s2 * L2);
}

static void control(const double q[7], const double v[4], const double ref[12], double th[7],
                    double tau[4], double e[4], double s[4]) {
    double c0 = cos(q[2]), s0 = sin(q[2]), c1 = cos(q[5]), s1 = sin(q[5]);
    double c2 = cos(q[6]), s2 = sin(q[6]), c12 = c1 * c2 - s1 * s2, s12 = s1 * c2 + c1 * s2;
    double cs[6] = {c0, s0, c1, s1, c12, s12};
    double u = 0.5 * r * (v[0] + v[1]), w = 0.5 * r / b * (v[0] - v[1]), A = w + v[2];
    double B = A + v[3], gx = l + L1 * c1 + L2 * c12, gy = L1 * s1 + L2 * s12;
    double x[4] = {q[0] + c0 * gx - s0 * gy, q[1] + s0 * gx + c0 * gy, q[0] + c0 * l,
                   q[1] + s0 * l};
    double hx = u - L1 * s1 * A - L2 * s12 * B, hy = l * w + L1 * c1 * A + L2 * c12 * B;
    double xd[4] = {c0 * hx - s0 * hy, s0 * hx + c0 * hy, c0 * u - s0 * l * w,
                    s0 * u + c0 * l * w};
    double xr[4], ar[4], uu[4], vr[4], acc[4], ws[4];
    for (int i = 0; i < 4; i++) {
        double rate = xd[i] - ref[4 + i];
        e[i] = x[i] - ref[i];
        s[i] = rate + 2.0 * e[i];
        xr[i] = ref[4 + i] - 2.0 * e[i];
        ar[i] = ref[8 + i] - 2.0 * rate;
        uu[i] = -100.0 * s[i] - 100.0 * tanh(s[i] / 0.2);
    }
    inverse(cs, xr[0], xr[1], xr[2], xr[3], vr);
    double fx = -w * l * vr[1], fy = w * vr[0], k1 = L1 * A * vr[2], k2 = L2 * B * vr[3];
    double ex = fx - k1 * c1 - k2 * c12, ey = fy - k1 * s1 - k2 * s12;
    inverse(cs, ar[0] - (c0 * ex - s0 * ey), ar[1] - (s0 * ex + c0 * ey),
            ar[2] - (c0 * fx - s0 * fy), ar[3] - (s0 * fx + c0 * fy), acc);
    double px = acc[0] - l * w * vr[1], py = l * acc[1] + w * vr[0];
    double x1 = -s1 * acc[2] - c1 * A * vr[2], y1 = c1 * acc[2] - s1 * A * vr[2];
    double x2 = -s12 * acc[3] - c12 * B * vr[3], y2 = c12 * acc[3] - s12 * B * vr[3];
    double a3 = c1 * py - s1 * px, a4 = L1 * (c2 * acc[3] - s2 * B * vr[3]);
    double b4 = c12 * py - s12 * px + L1 * (c2 * acc[2] + s2 * A * vr[2]);
    double tx = c0 * uu[0] + s0 * uu[1], ty = c0 * uu[1] - s0 * uu[0];
    double zx = c0 * uu[2] + s0 * uu[3], zy = c0 * uu[3] - s0 * uu[2];
    double fu = acc[0] * th[0] - w * vr[1] * th[2] + x1 * th[3] + x2 * th[4] + tx + zx;
    double fw = acc[1] * th[1] + w * vr[0] * th[2] + l * (y1 * th[3] + y2 * th[4]) + l * (ty + zy);
    double fa = a3 * th[3] + a4 * th[4] + acc[2] * th[5] + L1 * (c1 * ty - s1 * tx);
    double fb = b4 * th[4] + acc[3] * th[6] + L2 * (c12 * ty - s12 * tx);
    double turn = 0.5 * r / b * (fw + fa + fb);
    tau[0] = 0.5 * r * fu + turn; tau[1] = 0.5 * r * fu - turn; tau[2] = fa + fb; tau[3] = fb;
    inverse(cs, s[0], s[1], s[2], s[3], ws);
    th[0] -= T * acc[0] * ws[0];
    th[1] -= T * acc[1] * ws[1];
    th[2] -= T * (-w * vr[1] * ws[0] + w * vr[0] * ws[1]);
    th[3] -= T * (x1 * ws[0] + l * y1 * ws[1] + a3 * ws[2]);
    th[4] -= T * (x2 * ws[0] + l * y2 * ws[1] + a4 * ws[2] + b4 * ws[3]);
    th[5] -= T * acc[2] * ws[2];
    th[6] -= T * acc[3] * ws[3];
}

static void run(void) {
    double q[7] = {0, 0, M_PI / 2, 0, 0, M_PI / 4, -M_PI / 2}, v[4] = {0}, th[7], h = T / 2;
    for (int j = 0; j < 7; j++) th[j] = 0.5 * theta[j];
    for (int k = 0; k < N; k++) {
        double t = k * T, g = 0.2 * M_PI;
        double ref[12] = {0.2 * t + 0.3, 0.5 + 0.25 * sin(g * t), 0.2 * t, 0,
                          0.2, 0.25 * g * cos(g * t), 0.2, 0, 0, -0.25 * g * g * sin(g * t), 0, 0};
        for (int j = 0; j < 12; j++) REF[k][j] = ref[j];
        for (int j = 0; j < 7; j++) { X[k][j] = q[j]; TH[k][j] = th[j]; }
        for (int j = 0; j < 4; j++) V[k][j] = v[j];
        control(q, v, REF[k], th, TAU[k], E[k], S[k]);
        for (int step = 0; step < 2; step++) {
            double t0[4], t1[4], t2[4], dq[4][7], dv[4][4], p[7], y[4];
            disturbed(TAU[k], t + step * h, t0);
            disturbed(TAU[k], t + (step + 0.5) * h, t1);
            disturbed(TAU[k], t + (step + 1.0) * h, t2);
            forward(q, v, t0, dq[0], dv[0]);
            for (int stage = 1; stage < 4; stage++) {
                double f = stage == 3 ? h : 0.5 * h;
                for (int j = 0; j < 7; j++) p[j] = q[j] + f * dq[stage - 1][j];
                for (int j = 0; j < 4; j++) y[j] = v[j] + f * dv[stage - 1][j];
                forward(p, y, stage == 3 ? t2 : t1, dq[stage], dv[stage]);
            }
            for (int j = 0; j < 7; j++)
                q[j] += h / 6 * (dq[0][j] + 2 * dq[1][j] + 2 * dq[2][j] + dq[3][j]);
            for (int j = 0; j < 4; j++)
                v[j] += h / 6 * (dv[0][j] + 2 * dv[1][j] + 2 * dv[2][j] + dv[3][j]);
        }
    }
}

int main(void) {
    double best = 1e9, e = 0, f = 0;
    for (int i = 0; i < 11; i++) {
        struct timespec a, z;
        clock_gettime(CLOCK_MONOTONIC, &a);
        run();
        clock_gettime(CLOCK_MONOTONIC, &z);
        double ms = 1e3 * (z.tv_sec - a.tv_sec) + 1e-6 * (z.tv_nsec - a.tv_nsec);
        if (ms < best) best = ms;
    }
    for (int k = 10000; k < 20000; k++) {
        e += E[k][0] * E[k][0] + E[k][1] * E[k][1];
        f += E[k][2] * E[k][2] + E[k][3] * E[k][3];
    }
    double processor = 1e3 * clock() / CLOCKS_PER_SEC / 11;
    printf("%.2f %.6f %.6f %.2f\n", best, 1e3 * sqrt(e / 1e4), 1e3 * sqrt(f / 1e4), processor);
    return 0;
}
