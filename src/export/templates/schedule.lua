--[[
@BANNER@
Use in a script:

    local law = require("@P@_schedule")
    local K_P = law.place("gains.roll.k_p")       -- once
    local function update()
        local speed = law.true_airspeed()
        if speed then
            law.look_up(speed)                    -- m/s, true airspeed
            local k_p = law.value(K_P)            -- 1/s^2
        end
        return update, 20
    end

The tables are strings of 32-bit numbers, which is what ArduPilot's Lua
computes in: seven digits. look_up, value and turn_blend leave no garbage
behind. The numbers stand in the comments below, too.
]]

local law = {}

law.name = "@P@"
law.requirements_met = @MET@

-- Breakpoints.
local POINTS = @POINTS@

-- True airspeed of the breakpoints, m/s.
local SPEEDS = "@SPEEDS@"

-- Tables, their rows and their columns; numbers follow by rows.
local TABLES = {
@NAMES@}

-- One letter a number: v varies with speed, c is the same at all speeds.
local KINDS = "@KINDS@"

-- The numbers in their order, over the breakpoints:
--
@LISTING@
-- The numbers that vary, of each breakpoint.
local DATA = {
@DATA@}

-- Those that do not.
local FIXED = "\z
@FIXED@    "

local unpack = string.unpack

-- Places of the breakpoints around the speed that was looked up last, and the
-- weight of the upper one.
local low, high, weight = 0, 0, 0.0

-- The place of a number by its name, such as "gains.roll.k_p".
function law.place(name)
    local k = 0
    local count = { c = 0, v = 0 }
    for i = 1, #TABLES do
        local form, rows, columns = string.match(TABLES[i], "(.*):(.*):(.*)")
        for row in string.gmatch(rows, "%S+") do
            for column in string.gmatch(columns, "%S+") do
                k = k + 1
                local kind = string.sub(KINDS, k, k)
                local entry = form .. "." .. row
                if column ~= "value" then
                    entry = entry .. "." .. column
                end
                if entry == name then
                    -- Below zero for a number that does not vary.
                    return kind == "v" and count.v or -1 - count.c
                end
                count[kind] = count[kind] + 1
            end
        end
    end
    error("@P@: there is no number " .. name)
end

-- Settles the speed at which value() reads: true airspeed, m/s.
function law.look_up(speed)
    local k = 0
    while k < POINTS and unpack("<f", SPEEDS, 4 * k + 1) <= speed do
        k = k + 1
    end
    low = math.max(k - 1, 0)
    high, weight = low, 0.0
    if k >= 1 and k < POINTS then
        high = k
        local a = unpack("<f", SPEEDS, 4 * low + 1)
        local b = unpack("<f", SPEEDS, 4 * high + 1)
        weight = (speed - a) / (b - a)
    end
end

-- A number at the speed of look_up: linear between breakpoints, constant beyond
-- the ends.
function law.value(place)
    if place < 0 then
        return (unpack("<f", FIXED, -4 * place - 3))
    end
    local a = unpack("<f", DATA[low + 1], 4 * place + 1)
    local b = unpack("<f", DATA[high + 1], 4 * place + 1)
    return (1.0 - weight) * a + weight * b
end

-- True airspeed in m/s, or nil: ArduPilot measures equivalent airspeed.
function law.true_airspeed()
    local equivalent = ahrs:airspeed_estimate()
    if not equivalent then
        return nil
    end
    return equivalent * ahrs:get_EAS2TAS()
end

-- Weight of turn coordination at a true airspeed: 0 below the blend, 1 above.
function law.turn_blend(airspeed)
@CONSTANTS@@TURN_BLEND@    return turn_blend
end

return law
