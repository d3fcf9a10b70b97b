--[[
@BANNER@
Use in a script:

    local law = require("@P@_schedule")
    local v = law.at(20.0)                -- m/s, true airspeed
    local k_p = v.gains.roll.k_p          -- 1/s^2
    local b = v.allocation.lat.phi_ddot   -- % per rad/s^2

ArduPilot's Lua computes in 32 bit: seven digits.
]]

local law = {}

law.name = "@P@"
law.requirements_met = @MET@
law.warnings = {@WARNINGS@}

-- Numbers that do not depend on speed.
law.constants = {
@CONSTANTS@}

-- True airspeed of the breakpoints, m/s.
law.speeds = {@SPEEDS@}

-- Rows, columns and values of each table, one list of values a breakpoint, by
-- rows.
law.tables = {
@TABLES@}

-- Every table at a true airspeed in m/s, as values[table][row][column]: linear
-- between breakpoints, constant beyond the ends.
function law.at(speed)
    local speeds = law.speeds
    local k = 0
    while k < #speeds and speeds[k + 1] <= speed do
        k = k + 1
    end
    local low = math.max(k, 1)
    local high = low
    local t = 0.0
    if k >= 1 and k < #speeds then
        high = k + 1
        t = (speed - speeds[low]) / (speeds[high] - speeds[low])
    end
    local s = 1.0 - t
    local values = {}
    for name, form in pairs(law.tables) do
        local a, b = form.values[low], form.values[high]
        local matrix = {}
        for i, row in ipairs(form.rows) do
            local line = {}
            for j, column in ipairs(form.columns) do
                local n = (i - 1) * #form.columns + j
                line[column] = s * a[n] + t * b[n]
            end
            matrix[row] = line
        end
        values[name] = matrix
    end
    return values
end

-- Weight of turn coordination at a true airspeed: 0 below the blend, 1 above.
function law.turn_blend(airspeed)
    local c = law.constants
@TURN_BLEND@    return turn_blend
end

return law
