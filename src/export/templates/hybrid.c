    for (unsigned int i = 0u; i < 4u; i++) {
        nu[i] += cancelled(&p[@U@_FEEDBACK + (8u * i)], ideal);
        commanded[i] -= dot(&p[@U@_FEEDBACK + (8u * i)], ideal, 8u);
    }
    lifting = lift_moment(p, ideal, commanded);
