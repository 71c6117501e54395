% The smallest entry in Octave: octave --no-gui --quiet stub.m FOLDER
folder = argv(){end};
toml = fileread(fullfile(folder, 'campaign.toml'));
model = regexp(toml, 'model = "([^"]+)"', 'tokens'){1}{1};
bodies = regexp(fileread(fullfile(folder, model)), '<body[^>]*name="([^"]+)"', 'tokens');
answer = ['{"format": 1, "none": 0.2, "unexplained": 0.5, "sets": [{"probability": 0.3, ' ...
          '"causes": [{"effect": "mass_error", "places": ["body:%s"]}]}]}'];
printf([answer "\n"], bodies{end}{1});
