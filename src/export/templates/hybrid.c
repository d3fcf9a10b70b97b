    for (unsigned int i = 0u; i < 4u; i++) {
        acceleration[i] -= dot(&p[@U@_FEEDBACK + (8u * i)], ideal, 3u) * (@ONE@ - KAPPA);
    }
