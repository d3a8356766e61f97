/* FMI 2.0 and 3.0 co-simulation around a model. `model.h` is generated; the headers are those of the FMI project. */
#include "model.h"
#include "core.c"
#include "fmi2Functions.h"
#include "fmi3Functions.h"

typedef struct {
    Model model;
    void *environment;
    fmi2CallbackLogger log2;
    fmi3LogMessageCallback log3;
    char *name;
} Instance;

static void say(Instance *c, const char *text)
{
    if (c->log2) c->log2(c->environment, c->name, fmi2Error, "logStatusError", "%s", text);
    if (c->log3) c->log3(c->environment, fmi3Error, "logStatusError", text);
}

static Instance *create(const char *name, const char *token)
{
    if (!token || strcmp(token, TOKEN)) return NULL;
    Instance *c = calloc(1, sizeof *c);
    if (!c) return NULL;
    const char *given = name ? name : "";
    c->name = malloc(strlen(given) + 1);
    if (!c->name) { free(c); return NULL; }
    strcpy(c->name, given);
    model_start(&c->model);
    return c;
}

static int get_numbers(Model *m, const uint32_t *vr, size_t n, double *value, size_t values)
{
    if (n != values) return 0;
    for (size_t i = 0; i < n; i++) {
        uint32_t r = vr[i];
        if (r == 0) value[i] = m->time_s;
        else if (r >= VR_U && r < VR_U + NU) value[i] = m->u[r - VR_U];
        else if (r >= VR_Y && r < VR_Y + NY) {
            if (m->unsettled && m->mode != CREATED) model_settle(m);
            value[i] = m->y[r - VR_Y];
        }
        else if (r >= VR_P && r < VR_P + NP) value[i] = m->p[r - VR_P];
        else return 0;
    }
    return 1;
}

static int set_numbers(Model *m, const uint32_t *vr, size_t n, const double *value, size_t values)
{
    if (n != values) return 0;
    for (size_t i = 0; i < n; i++) {
        uint32_t r = vr[i];
        if (r >= VR_U && r < VR_U + NU) {
            if (!isfinite(value[i])) return 0;
            m->u[r - VR_U] = value[i];
            if (m->mode != RUNNING) m->unsettled = 1;
        }
        else if (r < VR_P || model_set(m, (int)(r - VR_P), value[i])) return 0;
    }
    return 1;
}

static int switch_of(uint32_t r) { return r >= VR_ON && r < VR_ON + NS ? (int)(r - VR_ON) : -1; }

/* A switch is set before the start: what an effect remembers begins there. */
static int set_switch(Model *m, uint32_t r, int on)
{
    int k = switch_of(r);
    if (k < 0 || m->mode == RUNNING) return 0;
    m->on[k] = on != 0;
    m->unsettled = 1;
    return 1;
}

#define REFUSED "refused: no such variable, a value out of its bounds, or an output that is no number any more"
#define SELF Instance *c = (Instance *)instance; (void)c
#define DONE2(ok) ((ok) ? fmi2OK : (say(c, REFUSED), fmi2Error))
#define DONE3(ok) ((ok) ? fmi3OK : (say(c, REFUSED), fmi3Error))

/* ---- FMI 2.0 ---- */
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component instance, fmi2Boolean on, size_t n, const fmi2String categories[]) { return fmi2OK; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    Instance *c = type == fmi2CoSimulation ? create(name, guid) : NULL;
    if (c && callbacks) { c->log2 = callbacks->logger; c->environment = callbacks->componentEnvironment; }
    return c;
}
void fmi2FreeInstance(fmi2Component instance) { SELF; if (c) { free(c->name); free(c); } }
fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean given, fmi2Real tolerance, fmi2Real start, fmi2Boolean stops, fmi2Real stop)
{ SELF; c->model.start_s = c->model.time_s = start; return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component instance) { SELF; c->model.mode = INITIALISING; return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component instance) { SELF; model_settle(&c->model); c->model.mode = RUNNING; return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component instance) { SELF; c->model.mode = ENDED; return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component instance) { SELF; model_start(&c->model); return fmi2OK; }
fmi2Status fmi2GetReal(fmi2Component instance, const fmi2ValueReference vr[], size_t n, fmi2Real v[]) { SELF; return DONE2(get_numbers(&c->model, vr, n, v, n)); }
fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference vr[], size_t n, const fmi2Real v[]) { SELF; return DONE2(set_numbers(&c->model, vr, n, v, n)); }
fmi2Status fmi2GetBoolean(fmi2Component instance, const fmi2ValueReference vr[], size_t n, fmi2Boolean v[])
{ SELF; for (size_t i = 0; i < n; i++) { int k = switch_of(vr[i]); if (k < 0) return DONE2(0); v[i] = c->model.on[k]; } return fmi2OK; }
fmi2Status fmi2SetBoolean(fmi2Component instance, const fmi2ValueReference vr[], size_t n, const fmi2Boolean v[])
{ SELF; for (size_t i = 0; i < n; i++) if (!set_switch(&c->model, vr[i], v[i])) return DONE2(0); return fmi2OK; }
fmi2Status fmi2GetInteger(fmi2Component instance, const fmi2ValueReference vr[], size_t n, fmi2Integer v[]) { SELF; return DONE2(n == 0); }
fmi2Status fmi2SetInteger(fmi2Component instance, const fmi2ValueReference vr[], size_t n, const fmi2Integer v[]) { SELF; return DONE2(n == 0); }
fmi2Status fmi2GetString(fmi2Component instance, const fmi2ValueReference vr[], size_t n, fmi2String v[]) { SELF; return DONE2(n == 0); }
fmi2Status fmi2SetString(fmi2Component instance, const fmi2ValueReference vr[], size_t n, const fmi2String v[]) { SELF; return DONE2(n == 0); }
fmi2Status fmi2GetFMUstate(fmi2Component instance, fmi2FMUstate *s)
{ SELF; if (!*s && !(*s = malloc(sizeof(Model)))) return fmi2Error; memcpy(*s, &c->model, sizeof(Model)); return fmi2OK; }
fmi2Status fmi2SetFMUstate(fmi2Component instance, fmi2FMUstate s) { SELF; memcpy(&c->model, s, sizeof(Model)); return fmi2OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component instance, fmi2FMUstate *s) { free(*s); *s = NULL; return fmi2OK; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component instance, fmi2FMUstate s, size_t *n) { *n = sizeof(Model); return fmi2OK; }
fmi2Status fmi2SerializeFMUstate(fmi2Component instance, fmi2FMUstate s, fmi2Byte b[], size_t n)
{ SELF; if (n < sizeof(Model)) return DONE2(0); memcpy(b, s, sizeof(Model)); return fmi2OK; }
fmi2Status fmi2DeSerializeFMUstate(fmi2Component instance, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
{ SELF; if (n != sizeof(Model) || !(*s = malloc(sizeof(Model)))) return DONE2(0); memcpy(*s, b, n); return fmi2OK; }
fmi2Status fmi2GetDirectionalDerivative(fmi2Component instance, const fmi2ValueReference a[], size_t n, const fmi2ValueReference b[], size_t m, const fmi2Real d[], fmi2Real e[]) { return fmi2Error; }
fmi2Status fmi2SetRealInputDerivatives(fmi2Component instance, const fmi2ValueReference vr[], size_t n, const fmi2Integer o[], const fmi2Real v[]) { return fmi2Error; }
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component instance, const fmi2ValueReference vr[], size_t n, const fmi2Integer o[], fmi2Real v[]) { return fmi2Error; }
fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real t, fmi2Real h, fmi2Boolean keep) { SELF; return DONE2(!model_step(&c->model, t + h)); }
fmi2Status fmi2CancelStep(fmi2Component instance) { return fmi2Error; }
fmi2Status fmi2GetStatus(fmi2Component instance, const fmi2StatusKind k, fmi2Status *v) { return fmi2Discard; }
fmi2Status fmi2GetRealStatus(fmi2Component instance, const fmi2StatusKind k, fmi2Real *v)
{ SELF; if (k != fmi2LastSuccessfulTime) return fmi2Discard; *v = c->model.time_s; return fmi2OK; }
fmi2Status fmi2GetIntegerStatus(fmi2Component instance, const fmi2StatusKind k, fmi2Integer *v) { return fmi2Discard; }
fmi2Status fmi2GetBooleanStatus(fmi2Component instance, const fmi2StatusKind k, fmi2Boolean *v)
{ if (k != fmi2Terminated) return fmi2Discard; *v = 0; return fmi2OK; }
fmi2Status fmi2GetStringStatus(fmi2Component instance, const fmi2StatusKind k, fmi2String *v) { return fmi2Discard; }

/* ---- FMI 3.0 ---- */
const char *fmi3GetVersion(void) { return fmi3Version; }
fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[]) { return fmi3OK; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference needed[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    Instance *c = events ? NULL : create(name, token);
    if (c) { c->log3 = log; c->environment = environment; }
    return c;
}
fmi3Instance fmi3InstantiateModelExchange(fmi3String a, fmi3String b, fmi3String d, fmi3Boolean e, fmi3Boolean f, fmi3InstanceEnvironment g, fmi3LogMessageCallback h) { return NULL; }
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String a, fmi3String b, fmi3String d, fmi3Boolean e, fmi3Boolean f, fmi3InstanceEnvironment g, fmi3LogMessageCallback h, fmi3ClockUpdateCallback i, fmi3LockPreemptionCallback j, fmi3UnlockPreemptionCallback k) { return NULL; }
void fmi3FreeInstance(fmi3Instance instance) { fmi2FreeInstance(instance); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean given, fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean stops, fmi3Float64 stop)
{ SELF; c->model.start_s = c->model.time_s = start; c->model.mode = INITIALISING; return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) { return (fmi3Status)fmi2ExitInitializationMode(instance); }
fmi3Status fmi3Terminate(fmi3Instance instance) { return (fmi3Status)fmi2Terminate(instance); }
fmi3Status fmi3Reset(fmi3Instance instance) { return (fmi3Status)fmi2Reset(instance); }
fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Float64 v[], size_t values) { SELF; return DONE3(get_numbers(&c->model, vr, n, v, values)); }
fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3Float64 v[], size_t values) { SELF; return DONE3(set_numbers(&c->model, vr, n, v, values)); }
fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Boolean v[], size_t values)
{ SELF; for (size_t i = 0; i < n; i++) { int k = switch_of(vr[i]); if (k < 0) return DONE3(0); v[i] = c->model.on[k] != 0; } return fmi3OK; }
fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3Boolean v[], size_t values)
{ SELF; for (size_t i = 0; i < n; i++) if (!set_switch(&c->model, vr[i], v[i])) return DONE3(0); return fmi3OK; }
fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *s) { return (fmi3Status)fmi2GetFMUstate(instance, s); }
fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState s) { return (fmi3Status)fmi2SetFMUstate(instance, s); }
fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *s) { return (fmi3Status)fmi2FreeFMUstate(instance, s); }
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState s, size_t *n) { *n = sizeof(Model); return fmi3OK; }
fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState s, fmi3Byte b[], size_t n)
{ SELF; if (n < sizeof(Model)) return DONE3(0); memcpy(b, s, sizeof(Model)); return fmi3OK; }
fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte b[], size_t n, fmi3FMUState *s)
{ SELF; if (n != sizeof(Model) || !(*s = malloc(sizeof(Model)))) return DONE3(0); memcpy(*s, b, n); return fmi3OK; }
fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 t, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event, fmi3Boolean *ended, fmi3Boolean *early, fmi3Float64 *last)
{
    SELF;
    *event = *ended = *early = fmi3False;
    int ok = !model_step(&c->model, t + h);
    *last = c->model.time_s;
    return DONE3(ok);
}
#include "refusals.h"  /* generated: every other function of FMI 3.0, refusing */
