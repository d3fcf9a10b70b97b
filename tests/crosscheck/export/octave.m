% Looks the exported tables up at speeds and writes what it finds:
% octave octave.m DIRECTORY SPEEDS.csv OUT.csv
arguments = argv();
addpath(arguments{1});
warning('off', 'law_load:law');
law = law_load(fullfile(arguments{1}, 'law.mat'));
speeds = dlmread(arguments{2});
out = fopen(arguments{3}, 'w');
names = fieldnames(law.lookup);
for k = 1:numel(speeds)
    values = law.at(speeds(k));
    for n = 1:numel(names)
        if strcmp(names{n}, 'outputs')
            break  % the tables of the law come first
        end
        fprintf(out, '%.17g,', values.(names{n}).');
    end
    fprintf(out, '\n');
end
fclose(out);
