/* A model that steps on its own grid, around the generated equations. Plain data: a state is a copy of it. */
#include <string.h>

typedef struct {
    double p[NP + 1];                                   /* parameters: plant, effects, output at the start */
    int32_t on[NS + 1];                                 /* switches of the effects */
    double u[NU], y[NY];
    double start_s, time_s;
    int64_t done;                                       /* internal steps since the start */
    double coefficients[NC + 1], steady[NC + 1], effect[NE + 1], states[NX + 1], memory[NM + 1];
    int mode;
    int stale;                                          /* parameters changed: coefficients must be made anew */
    int unsettled;                                      /* so are the states: nothing has been simulated yet */
} Model;
enum { CREATED, INITIALISING, RUNNING, ENDED };

static void model_start(Model *m)
{
    memset(m, 0, sizeof *m);
    memcpy(m->p, P_START, sizeof P_START);
    memcpy(m->on, ON_START, sizeof ON_START);
    m->stale = m->unsettled = 1;
}

static void model_advance(Model *m, int64_t steps, int settle)
{
    if (m->stale) make_coefficients(m->p, m->coefficients, m->steady, m->effect);
    m->stale = 0;
    run(m->u, steps, m->done, settle, m->steady, m->coefficients, m->states, m->on, m->effect, m->memory, m->y);
    m->done += steps;
}

/* The steady state of the inputs and parameters as they are. */
static void model_settle(Model *m)
{
    memset(m->states, 0, sizeof m->states);
    memset(m->memory, 0, sizeof m->memory);
    initial_states(m->p, m->u, m->states);
    m->done = 0;
    model_advance(m, 0, 1);
    m->unsettled = 0;
}

/* Go on to a time with the inputs held: 0, or 1 when an output is no number any more. What is left of a step of the own
   grid is made up later. */
static int model_step(Model *m, double until_s)
{
    int64_t until = (int64_t)floor((until_s - m->start_s) / STEP_S + 1e-6);
    if (m->unsettled) model_settle(m);
    if (until > m->done) model_advance(m, until - m->done, 0);
    m->time_s = until_s;
    for (int k = 0; k < NY; k++)
        if (!isfinite(m->y[k])) return 1;
    return 0;
}

/* Set a parameter by its place: 0, or 1 when it is out of bounds or no number. */
static int model_set(Model *m, int place, double value)
{
    if (place < 0 || place >= NP) return 1;
    if (!(value >= P_LOW[place] && value <= P_HIGH[place]) && !isnan(P_START[place])) return 1;
    m->p[place] = value;
    m->stale = 1;
    if (m->mode != RUNNING) m->unsettled = 1;
    return 0;
}
