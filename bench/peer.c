/* What a person would write by hand for one plant: n = 2, both states measured, every size a constant.
   x0' = 2.5 cos t - a0 x0 - a1 x1 - a2 x1^3,  x1' = x0  (Raol 2016, (100)-(101)). */
#include <math.h>
#include <stddef.h>

#define N 2 /* states, and outputs */
#define P 3 /* parameters */
#define W (N + P)

static void rate(double t, const double *x, const double *a, double *f, double F[N][N], double G[N][P]) {
    f[0] = 2.5 * cos(t) - a[0] * x[0] - a[1] * x[1] - a[2] * x[1] * x[1] * x[1];
    f[1] = x[0];
    F[0][0] = -a[0];
    F[0][1] = -a[1] - 3.0 * a[2] * x[1] * x[1];
    F[1][0] = 1.0;
    F[1][1] = 0.0;
    for (int j = 0; j < P; j++) G[1][j] = 0.0;
    G[0][0] = -x[0];
    G[0][1] = -x[1];
    G[0][2] = -x[1] * x[1] * x[1];
}

/* One step of RK4 of x and of its tangent T (N, width): width N is d/dx0, width W has d/da behind it. */
static inline void advance(double t, double h, const double *a, double *x, int width, double T[N][W]) {
    static const double offset[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0, 2.0, 2.0, 1.0};
    double f[N] = {0}, F[N][N], G[N][P], at[N], dx[N] = {0}, Tn[N][W], k[N][W] = {{0}}, total[N][W] = {{0}};
    for (int stage = 0; stage < 4; stage++) {
        double c = offset[stage] * h, w = weight[stage];
        for (int i = 0; i < N; i++) {
            at[i] = x[i] + c * f[i];
            for (int j = 0; j < width; j++) Tn[i][j] = T[i][j] + c * k[i][j];
        }
        rate(t + c, at, a, f, F, G);
        for (int i = 0; i < N; i++) {
            dx[i] += w * f[i];
            for (int j = 0; j < width; j++) {
                double sum = j < N ? 0.0 : G[i][j - N];
                for (int l = 0; l < N; l++) sum += F[i][l] * Tn[l][j];
                k[i][j] = sum;
                total[i][j] += w * sum;
            }
        }
    }
    for (int i = 0; i < N; i++) {
        x[i] += h / 6.0 * dx[i];
        for (int j = 0; j < width; j++) T[i][j] += h / 6.0 * total[i][j];
    }
}

/* The extended Kalman filter: X (steps, N), C_out (steps, N, N). */
void ekf(ptrdiff_t steps, const double *t, const double *y, const double *a, const double *Q, const double *R,
         const double *x0, const double *C0, double *X, double *C_out) {
    double x[N], C[N][N];
    for (int i = 0; i < N; i++) {
        x[i] = x0[i];
        for (int j = 0; j < N; j++) C[i][j] = C0[i * N + j];
    }
    for (ptrdiff_t s = 0; s < steps; s++) {
        if (s > 0) {
            double h = t[s] - t[s - 1], T[N][W] = {{0}}, M[N][N];
            for (int i = 0; i < N; i++) T[i][i] = 1.0;
            advance(t[s - 1], h, a, x, N, T);
            for (int i = 0; i < N; i++)
                for (int j = 0; j < N; j++) {
                    M[i][j] = 0.0;
                    for (int l = 0; l < N; l++) M[i][j] += T[i][l] * C[l][j];
                }
            for (int i = 0; i < N; i++)
                for (int j = 0; j < N; j++) {
                    C[i][j] = i == j ? Q[i] * h : 0.0;
                    for (int l = 0; l < N; l++) C[i][j] += M[i][l] * T[j][l];
                }
        }
        for (int c = 0; c < N; c++) {
            double z = y[s * N + c], K[N];
            if (isnan(z)) continue;
            double variance = C[c][c] + R[c], e = z - x[c];
            for (int i = 0; i < N; i++) K[i] = C[i][c];
            for (int i = 0; i < N; i++) x[i] += K[i] / variance * e;
            for (int i = 0; i < N; i++)
                for (int j = 0; j < N; j++) C[i][j] -= K[i] * K[j] / variance;
        }
        for (int i = 0; i < N; i++) {
            X[s * N + i] = x[i];
            for (int j = 0; j < N; j++) C_out[(s * N + i) * N + j] = C[i][j];
        }
    }
}

/* Errors of the simulation, (y - x) / sigma, (steps, N), and their slopes by x0 and a, J (steps, N, W). */
void output_errors(ptrdiff_t steps, const double *t, const double *y, const double *a, const double *sigma,
                   const double *x0, double *e, double *J) {
    double x[N], S[N][W] = {{0}};
    for (int i = 0; i < N; i++) {
        x[i] = x0[i];
        S[i][i] = 1.0;
    }
    for (ptrdiff_t s = 0; s < steps; s++) {
        if (s > 0) {
            /* The tangent goes on from where it is: the chain rule costs nothing of its own. */
            advance(t[s - 1], t[s] - t[s - 1], a, x, W, S);
        }
        for (int c = 0; c < N; c++) {
            int seen = !isnan(y[s * N + c]);
            e[s * N + c] = seen ? (y[s * N + c] - x[c]) / sigma[c] : 0.0;
            for (int j = 0; j < W; j++) J[(s * N + c) * W + j] = seen ? -S[c][j] / sigma[c] : 0.0;
        }
    }
}
