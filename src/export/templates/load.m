function law = @P@_load(file)
%@U@_LOAD  Reads @P@.mat into a struct for scripts and for Simulink.
%
@BANNER@%
%   law = @P@_load()          reads @P@.mat beside this function
%   law = @P@_load(file)      reads another file
%
%   law.speed                 breakpoints, m/s, true airspeed
%   law.constants.kappa ...   numbers that do not depend on speed
%   law.tables.feedback       .values rows x columns x breakpoints, .rows,
%                             .columns, .units (rows x columns), .meaning
%   law.lookup.feedback       for a 1-D Lookup Table block: .breakpoints,
%                             .data breakpoints x (rows*columns) with rows
%                             running fastest, .interpolation 'Linear point-slope',
%                             .extrapolation 'Clip'
%   law.at(speed)             struct of matrices at a true airspeed
    if nargin < 1
        file = fullfile(fileparts(mfilename('fullpath')), '@P@.mat');
    end
    raw = load(file);
    if ~isfield(raw, 'schema') || ~strcmp(raw.schema, '@SCHEMA@')
        error('@P@_load:schema', '%s is not of schema @SCHEMA@', file);
    end
    law.name = raw.name;
    law.requirements_met = raw.requirements_met ~= 0;
    law.warnings = raw.warnings;
    for k = 1:numel(law.warnings)
        warning('@P@_load:law', '%s', law.warnings{k});
    end
    law.rules = raw.rules;
    law.speed = raw.speed(:);
    if any(diff(law.speed) <= 0)
        error('@P@_load:speed', 'speeds are not strictly increasing');
    end
    count = numel(law.speed);
    for k = 1:numel(raw.constant_names)
        law.constants.(raw.constant_names{k}) = raw.constant_values(k);
    end
    for k = 1:numel(raw.table_names)
        name = raw.table_names{k};
        values = raw.(name);
        table = struct();
        table.values = values;
        table.rows = raw.([name '_rows']);
        table.columns = raw.([name '_columns']);
        rows = numel(table.rows);
        columns = numel(table.columns);
        if numel(values) ~= rows * columns * count
            error('@P@_load:size', 'table %s has another size', name);
        end
        table.units = reshape(raw.([name '_units']), rows, columns);
        table.meaning = raw.table_meanings{k};
        law.tables.(name) = table;
        lookup = struct();
        lookup.breakpoints = law.speed;
        lookup.data = reshape(values, rows * columns, count).';
        lookup.interpolation = 'Linear point-slope';
        lookup.extrapolation = 'Clip';
        law.lookup.(name) = lookup;
    end
    law.at = @(speed) at(law, speed);
end

function values = at(law, speed)
    v = min(max(speed, law.speed(1)), law.speed(end));
    names = fieldnames(law.lookup);
    for k = 1:numel(names)
        lookup = law.lookup.(names{k});
        table = law.tables.(names{k});
        if numel(law.speed) > 1
            row = interp1(law.speed, lookup.data, v, 'linear');
        else
            row = lookup.data;
        end
        values.(names{k}) = reshape(row, numel(table.rows), numel(table.columns));
    end
end
