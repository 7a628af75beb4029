/* Stands in for Elveflow64.dll: the vendor's signatures, an instrument that holds what it is told, faults on request.
   With -DPER_CALL the SDK up to 3.08.06, without it 3.10. Written from the signatures alone. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
#define API __declspec(dllexport)
#define REST Sleep(1000)
#else
#include <unistd.h>
#define API
#define REST sleep(1)
#endif
#define HANGS 7777

static double told[5];
static int is_open;
static int code_to_return;

static void note(const char *text) { /* what reached the "instrument", for the test to read */
    const char *path = getenv("STAND_IN_LOG");
    FILE *file = path ? fopen(path, "a") : NULL;
    if (file) { fprintf(file, "%s\n", text); fclose(file); }
    const char *fault = getenv("STAND_IN_FAULT");
    FILE *said = fault ? fopen(fault, "r") : NULL;
    code_to_return = 0;
    if (said) { if (fscanf(said, "%d", &code_to_return) != 1) code_to_return = 0; fclose(said); }
    if (code_to_return == HANGS) { /* once: whoever loads the library next finds it well */
        remove(fault);
        for (;;) REST;
    }
}

API int32_t OB1_Initialization(char name[], uint16_t r1, uint16_t r2, uint16_t r3, uint16_t r4, int32_t *id) {
    char text[200];
    snprintf(text, sizeof text, "init %s %d %d %d %d", name, r1, r2, r3, r4);
    note(text);
    if (strcmp(name, "01F64B3B") != 0 || is_open) return -8001;
    is_open = 1;
    *id = 0;
    return 0;
}

API int32_t OB1_Destructor(int32_t id) {
    (void)id;
    note("close");
    is_open = 0;
    return 0;
}

API int32_t OB1_Set_Trig(int32_t id, int32_t level) {
    char text[50];
    (void)id;
    snprintf(text, sizeof text, "trigger %d", level);
    note(text);
    return code_to_return;
}

static int32_t set(int32_t id, int32_t channel, double mbar) {
    char text[100];
    if (id != 0 || !is_open || channel < 1 || channel > 4) return -8002;
    snprintf(text, sizeof text, "set %d %g", channel, mbar);
    note(text);
    if (code_to_return) return code_to_return;
    told[channel] = mbar;
    return 0;
}

#ifdef PER_CALL
static double sampled[5];

API int32_t Elveflow_Calibration_Default(double table[], int32_t size) {
    for (int i = 0; i < size; i++) table[i] = 42.0;
    return size == 1000 ? 0 : -8003;
}

API int32_t Elveflow_Calibration_Load(char path[], double table[], int32_t size) {
    FILE *file = fopen(path, "r");
    if (!file) return -8004;
    fclose(file);
    return Elveflow_Calibration_Default(table, size);
}

API int32_t OB1_Set_Press(int32_t id, int32_t channel, double mbar, double *table, int32_t size) {
    if (size != 1000 || table[0] != 42.0 || table[999] != 42.0) return -8005;
    return set(id, channel, mbar);
}

API int32_t OB1_Get_Press(int32_t id, int32_t channel, int32_t acquire, double *table, double *mbar, int32_t size) {
    if (id != 0 || size != 1000 || table[999] != 42.0) return -8005;
    note("get");
    if (acquire) memcpy(sampled, told, sizeof told);
    *mbar = code_to_return ? 0.0 : sampled[channel];
    return code_to_return == 1 ? 0 : code_to_return; /* 1: the link is lost and it says nothing */
}
#else
API int32_t OB1_Calib_Load(int32_t id, char path[]) {
    FILE *file = fopen(path, "r");
    if (id != 0 || !file) return -8004;
    fclose(file);
    return 0;
}

API int32_t OB1_Set_Press(int32_t id, int32_t channel, double mbar) { return set(id, channel, mbar); }

API int32_t OB1_Get_Data(int32_t id, int32_t channel, double *mbar, double *sensor) {
    if (id != 0) return -8002;
    note("get");
    *mbar = code_to_return ? 0.0 : told[channel];
    *sensor = 0.0;
    return code_to_return == 1 ? 0 : code_to_return;
}
#endif
