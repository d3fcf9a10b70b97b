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

The tables are one string of 32-bit numbers, which is what ArduPilot's Lua
computes in: seven digits. look_up, value and turn_blend leave no garbage
behind. The numbers stand in the comments below, too.
]]

local law = {}

law.name = "@P@"
law.requirements_met = @MET@

-- Numbers at one speed, and breakpoints.
local COUNT, POINTS = @COUNT@, @POINTS@

-- True airspeed of the breakpoints, m/s.
local SPEEDS = "@SPEEDS@"

-- Names of the numbers.
local NAMES = "\z
    @NAMES@"

-- The numbers in the order of the names, over the breakpoints:
--
@LISTING@
-- All numbers of a breakpoint, one breakpoint after the other.
local DATA = "\z
@DATA@    "

local unpack = string.unpack

-- Places of the breakpoints around the speed that was looked up last, and the
-- weight of the upper one.
local low, high, weight = 0, 0, 0.0

-- The place of a number by its name, such as "gains.roll.k_p".
function law.place(name)
    local k = 0
    for other in string.gmatch(NAMES, "%S+") do
        if other == name then
            return k
        end
        k = k + 1
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
    local a = unpack("<f", DATA, 4 * (low * COUNT + place) + 1)
    local b = unpack("<f", DATA, 4 * (high * COUNT + place) + 1)
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
