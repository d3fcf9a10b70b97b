
/* Pitch acceleration of the lift that the references ask for, beyond what the
 * tables over speed know: it goes with the tail's load, as u w does. The
 * collective grows together with the load, pedals come and go with it. */
static real lift_moment(const real *p, const real ideal[8], const real commanded[4])
{
    const real *trim = &p[@U@_TRIM_VELOCITY];
    const real load = ((trim[0] + ideal[0]) * (trim[2] + ideal[2])) - (trim[0] * trim[2]);
    const real collective = dot(&p[@U@_DECOUPLING + (4u * @U@_COL)], commanded, 4u);
    const real pedal
        = dot(&p[@U@_DECOUPLING + (4u * @U@_PED)], commanded, 4u) / pedal_power(p, collective);
    return load
        * ((@HALF@ * COLLECTIVE_PITCH_GROWTH * collective) + (PEDAL_PITCH_GROWTH * pedal));
}
